//! Weights of the networks for bad cases.
//!
//! Bounds are fractions, and strict ones an infinitesimal less. Multiplied by their common
//! denominator, they almost always fit whole numbers, which are several times faster and equally
//! exact.

use elbowroom_num::{CommonDenominator, Delta, Rational};
use elbowroom_stn::Weight;

use crate::reduction::{Edge, Reduction};
use elbowroom_plan::DecoupledEnvelope;

/// A mapping from bounds to weights that preserves sums and comparisons.
pub(crate) trait Scale {
    /// The weight of a bound.
    type Weight: Weight;

    /// Returns the bound's weight.
    fn weight(&self, bound: &Delta) -> Self::Weight;

    /// Returns `true` if a time is no larger than the length of a path can be, so that sums with it
    /// fit.
    fn is_moderate(&self, time: &Self::Weight) -> bool;
}

/// Bounds are their own weights.
#[derive(Clone, Debug)]
pub(crate) struct ExactScale;

impl Scale for ExactScale {
    type Weight = Delta;

    fn weight(&self, bound: &Delta) -> Delta {
        bound.clone()
    }

    fn is_moderate(&self, _time: &Delta) -> bool {
        true
    }
}

/// Whole numbers: multiples of `1 / denominator`, each [`UNIT`] δ.
#[derive(Clone, Debug)]
pub(crate) struct IntegerScale {
    denominator: i64,
}

/// Number of δ in the smallest difference of two bounds; more than any sum contains.
const UNIT: i128 = 1 << 40;

/// Upper bound on the sum of all weights on a path without repetition, δ aside.
const LARGEST_PATH: i128 = 1 << 60;

impl Scale for IntegerScale {
    type Weight = i128;

    fn weight(&self, bound: &Delta) -> i128 {
        let whole = |number: &Rational| {
            let (numerator, own) = number.as_small().expect("looked at before");
            i128::from(numerator) * i128::from(self.denominator / own)
        };
        let (infinitesimal, _) = bound.infinitesimal.as_small().expect("0 or -1");
        if bound.real.is_zero() {
            return i128::from(infinitesimal);
        }
        whole(&bound.real) * UNIT + i128::from(infinitesimal)
    }

    fn is_moderate(&self, time: &i128) -> bool {
        time.abs() <= LARGEST_PATH * UNIT
    }
}

impl IntegerScale {
    /// Returns the scale for the schedules of a box, for differences with the bounds in `numbers`;
    /// `None` if the numbers are so large that sums might not fit.
    ///
    /// A schedule's times lie between sums of paths, and those are at most [`LARGEST_PATH`] units.
    /// The searches add a few such sums for each constraint that is added; 127 bits are enough for
    /// millions.
    pub(crate) fn fitting(
        reduction: &Reduction,
        envelope: &DecoupledEnvelope,
        numbers: &Numbers,
    ) -> Option<Self> {
        let mut all = numbers.clone();
        for interval in envelope.intervals() {
            for end in [&interval.lower, &interval.upper] {
                if let Some(value) = end.value() {
                    all.include(value)?;
                }
            }
        }
        // A bound is a constant plus an end, or a difference plus two offsets.
        let nodes = i128::try_from(reduction.class_count()).ok()? + 4;
        let largest = all.largest.checked_mul(i128::from(all.denominator.get()))?;
        let path = largest.checked_mul(3)?.checked_mul(nodes)?;
        (path < LARGEST_PATH).then_some(Self {
            denominator: all.denominator.get(),
        })
    }
}

/// The common denominator of some numbers, and a bound on their magnitude.
#[derive(Clone, Debug)]
pub(crate) struct Numbers {
    denominator: CommonDenominator,
    largest: i128,
}

impl Default for Numbers {
    fn default() -> Self {
        Self {
            denominator: CommonDenominator::default(),
            largest: 1,
        }
    }
}

impl Numbers {
    /// Includes a number. Returns `None` if the numbers become too large.
    pub(crate) fn include(&mut self, number: &Rational) -> Option<()> {
        let (numerator, own) = number.as_small()?;
        self.denominator.include(number)?;
        let magnitude = i128::from(numerator / own).abs() + 1;
        self.largest = self.largest.max(magnitude);
        Some(())
    }

    /// Includes the constants of edges.
    pub(crate) fn include_edges(&mut self, edges: &[Edge]) -> Option<()> {
        edges
            .iter()
            .try_for_each(|edge| self.include(&edge.constant))
    }
}

#[cfg(test)]
mod tests {
    use super::{Delta, IntegerScale, Numbers, Rational, Scale};
    use crate::reduction::Reduction;
    use elbowroom_plan::{DecoupledEnvelope, ParametrizedPlan, StnPlan};

    /// Returns the scale for these numbers in a plan without actions.
    fn fitting(inside: &[Rational], ends: &[Rational]) -> Option<IntegerScale> {
        let task = elbowroom_model::Task::new(elbowroom_model::Problem::default());
        let plan = StnPlan::unconstrained(&task, Vec::new());
        let reduction = Reduction::new(&ParametrizedPlan::closed(&task, plan));
        let mut numbers = Numbers::default();
        inside
            .iter()
            .try_for_each(|number| numbers.include(number))?;
        IntegerScale::fitting(
            &reduction,
            &DecoupledEnvelope::point(&ends.iter().cloned().collect()),
            &numbers,
        )
    }

    #[test]
    fn scaled_weights_add_and_compare_like_their_bounds() {
        let numbers = [(1, 1000), (-7, 3), (0, 1), (5, 1), (4999, 1000), (-1, 1000)]
            .map(|(numerator, denominator)| Rational::new(numerator, denominator));
        let scale = fitting(&numbers[..3], &numbers[3..]).unwrap();
        let bounds: Vec<Delta> = numbers
            .iter()
            .flat_map(|number| {
                [
                    Delta::from(number.clone()),
                    Delta::just_below(number.clone()),
                ]
            })
            .collect();
        for a in &bounds {
            for b in &bounds {
                assert_eq!(scale.weight(a).cmp(&scale.weight(b)), a.cmp(b));
                let sum = a + b;
                for c in &bounds {
                    let weight = scale.weight(a) + scale.weight(b);
                    assert_eq!(weight.cmp(&scale.weight(c)), sum.cmp(c), "{a} + {b}, {c}");
                }
            }
        }
    }

    #[test]
    fn numbers_too_large_or_of_too_many_denominators_do_not_fit() {
        let large = Rational::from(i64::MAX / 2);
        assert!(fitting(std::slice::from_ref(&large), &[]).is_none());
        assert!(fitting(&[], std::slice::from_ref(&large)).is_none());
        assert!(fitting(&[&large * &large], &[]).is_none());
        let prime = |p| Rational::new(1, p);
        let primes = [
            prime(1_000_003),
            prime(1_000_033),
            prime(1_000_037),
            prime(1_000_039),
        ];
        assert!(fitting(&primes[..2], &primes[2..]).is_none());
        assert!(
            fitting(
                &[Rational::from(1_000_000_000)],
                &[Rational::new(1, 64_000)]
            )
            .is_some()
        );
    }
}
