//! Check that no condition of the plan can fail in a schedule for values in the box: [`check`].
//!
//! Each possible violation of a condition is a system of linear inequalities over times and values,
//! together with the network's own bounds. A weighted sum of these with non-negative multipliers
//! proves that the system has no solution if all times cancel and the sum is greater than zero for
//! all values in the box (the easy half of Farkas' lemma).

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Constraint, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::sound::{
    Condition, Difference, FailureCase, Ground, Inequality, Multiplied, Summand, Violation,
};

/// Largest number of parameters of one violation whose ends are combined.
const MAX_CORNERS: usize = 8;

/// Checks the proof that the condition at this position cannot fail.
///
/// # Errors
/// The proof is not valid.
pub(crate) fn check(
    certificate: &Certificate,
    intervals: &Intervals,
    (index, condition): (usize, &Condition),
) -> Result<(), Flaw> {
    let points = certificate.points.len();
    let checker = Checker {
        certificate,
        intervals,
        index,
        points: points + usize::from(condition.during.is_some()),
    };
    let differences = match condition.during {
        Some([start, end]) if start < points && end < points => {
            vec![before(start, points), before(points, end)]
        }
        Some(_) => return Err(Flaw::Condition(index)),
        None => Vec::new(),
    };
    checker.cases(condition, differences)
}

/// Returns the difference that puts one point before the other.
fn before(earlier: usize, later: usize) -> Difference {
    Difference {
        from: later,
        to: earlier,
        most: Rational::ZERO,
        strict: true,
    }
}

struct Checker<'a> {
    certificate: &'a Certificate,
    intervals: &'a Intervals,
    /// Position of the condition.
    index: usize,
    /// Number of points, including the moment.
    points: usize,
}

impl Checker<'_> {
    fn flaw(&self) -> Flaw {
        Flaw::Condition(self.index)
    }

    /// Checks that the condition can fail in none of its cases.
    fn cases(&self, condition: &Condition, differences: Vec<Difference>) -> Result<(), Flaw> {
        let cases = &condition.cases;
        let mut is_seen = vec![false; cases.len()];
        let mut open = vec![(0, differences)];
        while let Some((index, differences)) = open.pop() {
            let case = cases.get(index).ok_or_else(|| self.flaw())?;
            if std::mem::replace(&mut is_seen[index], true) {
                return Err(self.flaw());
            }
            match case {
                FailureCase::Either { event, cases } => {
                    let moment = self.certificate.points.len();
                    if condition.during.is_none() || *event >= moment {
                        return Err(self.flaw());
                    }
                    let after = Difference {
                        strict: false,
                        ..before(*event, moment)
                    };
                    for (case, difference) in cases.iter().zip([after, before(moment, *event)]) {
                        let mut differences = differences.clone();
                        differences.push(difference);
                        open.push((*case, differences));
                    }
                }
                FailureCase::Never(sum) => {
                    self.check_contradiction(sum, (&differences, &[]), self.intervals)?
                }
                FailureCase::Ways(ways) => {
                    for way in ways {
                        self.check_violation(way, &differences)?;
                    }
                }
            }
        }
        let is_whole = is_seen.iter().all(|is_seen| *is_seen);
        is_whole.then_some(()).ok_or_else(|| self.flaw())
    }

    /// Checks that a violation is not possible.
    fn check_violation(&self, way: &Violation, known: &[Difference]) -> Result<(), Flaw> {
        let mut differences = known.to_vec();
        differences.extend(way.differences.iter().cloned());
        let count = way.corners.len();
        if count > MAX_CORNERS || way.sums.len() != 1 << count {
            return Err(self.flaw());
        }
        self.check_corners_suffice(way)?;
        for (corner, sum) in way.sums.iter().enumerate() {
            let mut intervals = self.intervals.clone();
            for (place, &parameter) in way.corners.iter().rev().enumerate() {
                let is_upper = (corner >> place) & 1 == 1;
                let narrowed = intervals.at_end(parameter, is_upper);
                intervals = narrowed.ok_or_else(|| self.flaw())?;
            }
            self.check_contradiction(sum, (&differences, &way.inequalities), &intervals)?;
        }
        Ok(())
    }

    /// Checks that it is sufficient to examine products at the corners. At most one inequality that
    /// the sums use contains a multiplied parameter, the network contains none, and none is squared
    /// unless its minimum is at an end. For fixed times and other values, the inequality is then
    /// easiest to satisfy with the parameter at one of its ends.
    fn check_corners_suffice(&self, way: &Violation) -> Result<(), Flaw> {
        let is_corner = |parameter: usize| way.corners.contains(&parameter);
        let in_network = self.certificate.constraints.iter().any(|own| {
            [&own.lower, &own.upper]
                .into_iter()
                .any(|limit| matches!(limit, Limit::Parameter(own) if is_corner(*own)))
        });
        let used = way
            .sums
            .iter()
            .flatten()
            .filter_map(|summand| match summand.of {
                Ground::Inequality(place) => Some(place),
                _ => None,
            });
        let mut multiplying: Vec<usize> = Vec::new();
        for place in used {
            let inequality = way.inequalities.get(place).ok_or_else(|| self.flaw())?;
            let products = inequality.products.iter();
            let convex = products.clone().any(|own| {
                own.by == Multiplied::Parameter(own.parameter) && own.factor.is_positive()
            });
            let is_open = products.clone().any(|own| {
                let is_other = match own.by {
                    Multiplied::Parameter(other) => !is_corner(other),
                    Multiplied::Time(_) => false,
                };
                is_other || !is_corner(own.parameter)
            });
            let in_values = inequality
                .parameters
                .iter()
                .any(|own| is_corner(own.parameter));
            if convex || is_open {
                return Err(self.flaw());
            }
            if (in_values || !inequality.products.is_empty()) && !multiplying.contains(&place) {
                multiplying.push(place);
            }
        }
        let is_decided = multiplying.len() <= 1 && !in_network;
        is_decided.then_some(()).ok_or_else(|| self.flaw())
    }

    /// Checks that a sum contradicts the differences and inequalities.
    fn check_contradiction(
        &self,
        sum: &[Summand],
        (differences, inequalities): (&[Difference], &[Inequality]),
        intervals: &Intervals,
    ) -> Result<(), Flaw> {
        let mut total = Total::default();
        for Summand { of, factor } in sum {
            if !factor.is_positive() {
                return Err(self.flaw());
            }
            let is_added = match *of {
                Ground::Beginning(point) => {
                    total.time(point, &-factor);
                    true
                }
                Ground::Least(index) => self.bound(&mut total, index, true, factor),
                Ground::Most(index) => self.bound(&mut total, index, false, factor),
                Ground::Difference(place) => {
                    let own = differences.get(place);
                    own.is_some_and(|own| {
                        total.difference(own.from, own.to, factor);
                        total.constant -= &own.most * factor;
                        total.is_strict |= own.strict;
                        true
                    })
                }
                Ground::Inequality(place) => {
                    let own = inequalities.get(place);
                    own.is_some_and(|own| total.inequality(own, factor, intervals).is_some())
                }
            };
            is_added.then_some(()).ok_or_else(|| self.flaw())?;
        }
        let is_left = total.times.iter().any(|(&point, factor)| {
            // Time zero is at 0.
            point >= self.points || (point != 0 && !factor.is_zero())
        });
        let minus: Vec<(usize, Rational)> = total.values.iter().map(|(p, f)| (*p, -f)).collect();
        let minus = minus.iter().map(|(parameter, factor)| (*parameter, factor));
        let greatest = intervals.greatest(-&total.constant, minus);
        let is_refuted =
            greatest.is_some_and(|own| own.is_negative() || (own.is_zero() && total.is_strict));
        let follows = is_refuted && !is_left;
        follows.then_some(()).ok_or_else(|| self.flaw())
    }

    /// Adds a bound of the network. Returns `false` if there is none.
    fn bound(&self, total: &mut Total, index: usize, is_least: bool, factor: &Rational) -> bool {
        let Some(constraint) = self.certificate.constraints.get(index) else {
            return false;
        };
        let Constraint { from, to, .. } = *constraint;
        let (limit, sign) = if is_least {
            total.difference(to, from, factor);
            (&constraint.lower, factor.clone())
        } else {
            total.difference(from, to, factor);
            (&constraint.upper, -factor)
        };
        match limit {
            Limit::None => return false,
            Limit::Number(number) => total.constant += &number.0 * &sign,
            Limit::Parameter(parameter) => total.value(*parameter, &sign),
        }
        true
    }
}

/// `constant + Σ factor · time + Σ factor · value`, which is at most 0, or less than that.
#[derive(Default)]
struct Total {
    constant: Rational,
    times: BTreeMap<usize, Rational>,
    values: BTreeMap<usize, Rational>,
    is_strict: bool,
}

impl Total {
    fn time(&mut self, point: usize, factor: &Rational) {
        *self.times.entry(point).or_default() += factor;
    }

    fn value(&mut self, parameter: usize, factor: &Rational) {
        *self.values.entry(parameter).or_default() += factor;
    }

    /// Adds `factor` times the time of `to` minus that of `from`.
    fn difference(&mut self, from: usize, to: usize, factor: &Rational) {
        self.time(to, factor);
        self.time(from, &-factor);
    }

    /// Adds `factor` times an inequality. The values that are multiplied have to be fixed.
    fn inequality(
        &mut self,
        own: &Inequality,
        factor: &Rational,
        intervals: &Intervals,
    ) -> Option<()> {
        let fixed = |parameter: usize| match intervals.of(parameter).ok()? {
            [Some(lower), Some(upper)] if lower == upper => Some(lower.clone()),
            _ => None,
        };
        self.constant += &own.constant * factor;
        for time in &own.times {
            self.time(time.point, &(&time.factor * factor));
        }
        for value in &own.parameters {
            self.value(value.parameter, &(&value.factor * factor));
        }
        for product in &own.products {
            let factor = &(&product.factor * &fixed(product.parameter)?) * factor;
            match product.by {
                Multiplied::Time(point) => self.time(point, &factor),
                Multiplied::Parameter(parameter) => self.value(parameter, &factor),
            }
        }
        self.is_strict |= own.strict;
        Some(())
    }
}
