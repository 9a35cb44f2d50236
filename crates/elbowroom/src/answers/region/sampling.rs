//! Volumes of bodies with too many coordinates for exact measurement, by seeded sampling.
//!
//! A chain of bodies leads from a box inside to the whole body; each is at most twice as large as
//! the one before. Their ratio is the reciprocal of the share of a random walk in the larger one
//! that falls into the smaller one. The walk moves along one coordinate at a time ("hit and run").
//! Several walks with different seeds estimate the variance.

use std::ops::ControlFlow;

use elbowroom_envelope::Component;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{RngCore, SeedableRng};

/// Number of walks.
const WALKS: u32 = 16;
/// Number of steps of a walk in each body, per coordinate.
const STEPS: usize = 120;

/// An estimated logarithm of a volume, and its variance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) logarithm: f64,
    pub(super) variance: f64,
}

/// `a x <= b`, by coordinate.
struct Rows {
    /// For each coordinate, the rows that contain it, with its factors.
    of: Vec<Vec<(usize, f64)>>,
    /// The slack of each row at the current position of the walk.
    slack: Vec<f64>,
}

/// Estimates the volume of a component; `None` if it has no interior, or `flow` breaks.
pub(super) fn estimate(
    component: &Component,
    seed: u64,
    flow: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Estimate> {
    let (middle, half) = component.inscribed()?;
    let float = |numbers: &[elbowroom_num::Rational]| -> Vec<f64> {
        numbers
            .iter()
            .map(elbowroom_num::Rational::to_f64)
            .collect()
    };
    let (middle, half) = (float(&middle), float(&half));
    let count = middle.len();
    let dimension = f64::from(u32::try_from(count).ok()?);
    // The rows of the frame come first. Twice its width around the middle covers the whole body.
    let furthest = (0..count).map(|place| {
        let (lower, upper) = (
            &component.rows[2 * place].1,
            &component.rows[2 * place + 1].1,
        );
        (upper.to_f64() + lower.to_f64()) / half[place]
    });
    let largest = furthest.fold(1.0, f64::max);
    let phases = (dimension * largest.log2()).ceil().max(0.0);
    let mut logarithm: f64 = half.iter().map(|half| (2.0 * half).ln()).sum();
    let mut variance = 0.0;
    let mut walks: Vec<Walk> = (0..WALKS)
        .map(|walk| Walk {
            position: vec![0.0; count],
            rows: Rows::around(component, &middle),
            random: ChaCha8Rng::seed_from_u64(seed.wrapping_add(u64::from(walk))),
        })
        .collect();
    let mut phase = 0.0;
    while phase < phases {
        if flow().is_break() {
            return None;
        }
        let inner = 2_f64.powf(phase / dimension);
        let outer = 2_f64.powf((phase + 1.0) / dimension);
        let shares: Vec<f64> = walks
            .iter_mut()
            .map(|walk| walk.share(&half, inner, outer))
            .collect();
        let walks = f64::from(WALKS);
        let mean = shares.iter().sum::<f64>() / walks;
        // A body is at most twice as large as the one before.
        let share = mean.clamp(0.5, 1.0);
        let spread: f64 = shares.iter().map(|own| (own - mean).powi(2)).sum();
        logarithm -= share.ln();
        variance += spread / (walks - 1.0) / walks / (share * share);
        phase += 1.0;
    }
    Some(Estimate {
        logarithm,
        variance,
    })
}

impl Rows {
    fn around(component: &Component, middle: &[f64]) -> Self {
        let mut of = vec![Vec::new(); middle.len()];
        let mut slack = Vec::with_capacity(component.rows.len());
        for (index, (factors, bound)) in component.rows.iter().enumerate() {
            let mut left = bound.to_f64();
            for (place, factor) in factors.iter().enumerate() {
                if !factor.is_zero() {
                    let factor = factor.to_f64();
                    of[place].push((index, factor));
                    left -= factor * middle[place];
                }
            }
            slack.push(left.max(0.0));
        }
        Self { of, slack }
    }
}

/// A random walk around the middle.
struct Walk {
    position: Vec<f64>,
    rows: Rows,
    random: ChaCha8Rng,
}

impl Walk {
    /// Walks in the body cut to `outer` times the inscribed box. Returns the share of its steps in
    /// the body cut to `inner` times that box.
    fn share(&mut self, half: &[f64], inner: f64, outer: f64) -> f64 {
        let count = half.len();
        let mut beyond = (0..count)
            .filter(|&at| self.position[at].abs() > inner * half[at])
            .count();
        let (mut steps, mut inside) = (0.0, 0.0);
        for _ in 0..STEPS {
            for _ in 0..count {
                let at = self.random_below(count);
                let limit = outer * half[at];
                let (mut lower, mut upper) =
                    (-limit - self.position[at], limit - self.position[at]);
                for (row, factor) in &self.rows.of[at] {
                    let reach = self.rows.slack[*row] / factor;
                    if *factor > 0.0 {
                        upper = upper.min(reach);
                    } else {
                        lower = lower.max(reach);
                    }
                }
                if lower < upper {
                    let was = self.position[at].abs() > inner * half[at];
                    let step = lower + (upper - lower) * self.unit();
                    self.position[at] += step;
                    for (row, factor) in &self.rows.of[at] {
                        let slack = &mut self.rows.slack[*row];
                        *slack = (*slack - factor * step).max(0.0);
                    }
                    let is = self.position[at].abs() > inner * half[at];
                    beyond = beyond + usize::from(is) - usize::from(was);
                }
                steps += 1.0;
                if beyond == 0 {
                    inside += 1.0;
                }
            }
        }
        inside / steps
    }

    /// Returns a uniform random number in `[0, 1)`.
    #[allow(clippy::cast_precision_loss, reason = "53 bits fit exactly")]
    fn unit(&mut self) -> f64 {
        (self.random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    #[allow(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        clippy::cast_precision_loss,
        reason = "an index below a small count"
    )]
    fn random_below(&mut self, count: usize) -> usize {
        ((self.unit() * count as f64) as usize).min(count - 1)
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use elbowroom_envelope::Component;
    use elbowroom_num::Rational;

    use super::estimate;

    /// `{x : 0 <= x_i <= 1, Σ x_i <= bound}`.
    fn body(dimension: usize, bound: Rational) -> Component {
        let mut rows = Vec::new();
        for place in 0..dimension {
            let mut unit = vec![Rational::ZERO; dimension];
            unit[place] = Rational::from(-1);
            rows.push((unit.clone(), Rational::ZERO));
            unit[place] = Rational::ONE;
            rows.push((unit, Rational::ONE));
        }
        rows.push((vec![Rational::ONE; dimension], bound));
        Component {
            parameters: (0..dimension).map(Into::into).collect(),
            rows,
        }
    }

    #[test]
    fn confidence_interval_has_its_nominal_coverage() {
        let flow = &mut || ControlFlow::Continue(());
        let mut inside = 0;
        for seed in 0..20 {
            for dimension in [2, 3, 5] {
                let bound = Rational::new(3, 2);
                let body = body(dimension, bound);
                let exact = body.volume(100_000, flow).expect("few sides").to_f64().ln();
                let found = estimate(&body, 100 * seed, flow).expect("an inside");
                let far = (found.logarithm - exact).abs();
                assert!(far < 0.3, "{dimension}: {found:?}, and exactly {exact}");
                inside += i32::from(far <= 1.96 * found.variance.sqrt());
            }
        }
        assert!(inside >= 51, "{inside} of 60");
    }

    #[test]
    fn volume_of_20_dimensional_simplex_matches_formula() {
        let flow = &mut || ControlFlow::Continue(());
        let exact: f64 = -(1..=20).map(|n| f64::from(n).ln()).sum::<f64>();
        let found = estimate(&body(20, Rational::ONE), 7, flow).expect("an inside");
        let far = (found.logarithm - exact).abs();
        assert!(
            far < 0.5 && far < 4.0 * found.variance.sqrt(),
            "{found:?} {exact}"
        );
        assert_eq!(
            found,
            estimate(&body(20, Rational::ONE), 7, flow).expect("the same")
        );
    }

    #[test]
    fn empty_interior_has_no_estimate() {
        let flow = &mut || ControlFlow::Continue(());
        assert_eq!(estimate(&body(3, Rational::ZERO), 0, flow), None);
    }
}
