//! Schedules that depend on the values, for the weak guarantee.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::sound::{Affine, Schedules};

/// Largest number of times to check, for all cases together.
const MAX_TIMES: usize = 1_000_000;

/// Checks that the cases have a schedule for all values in the box.
///
/// # Errors
/// The first flaw.
pub(super) fn check(
    certificate: &Certificate,
    intervals: &Intervals,
    cases: &[Schedules],
) -> Result<(), Flaw> {
    let points = certificate.points.len();
    if cases.len().saturating_mul(points) > MAX_TIMES {
        return Err(Flaw::TooLong);
    }
    let mut is_seen = vec![false; cases.len()];
    let mut open = vec![(0, intervals.clone())];
    while let Some((index, intervals)) = open.pop() {
        let case = cases
            .get(index)
            .ok_or(Flaw::UnknownReference("schedule", index))?;
        if std::mem::replace(&mut is_seen[index], true) {
            return Err(Flaw::Schedules(index));
        }
        match case {
            Schedules::Split { parameter, cases } => {
                for (case, is_upper) in cases.iter().zip([false, true]) {
                    let part = intervals.at_end(*parameter, is_upper);
                    open.push((*case, part.ok_or(Flaw::Schedules(index))?));
                }
            }
            Schedules::Rule(times) if times.len() == points => {
                rule(certificate, &intervals, times)?;
            }
            Schedules::Rule(times) => {
                return Err(Flaw::Count {
                    what: "times",
                    found: times.len(),
                    wanted: points,
                });
            }
        }
    }
    match is_seen.iter().position(|is_seen| !is_seen) {
        Some(index) => Err(Flaw::Schedules(index)),
        None => Ok(()),
    }
}

/// Checks that the times, as functions of the values, satisfy all constraints for all values.
fn rule(certificate: &Certificate, intervals: &Intervals, times: &[Affine]) -> Result<(), Flaw> {
    for (point, time) in times.iter().enumerate() {
        let is_zero = time.constant.is_zero() && time.parameters.is_empty();
        let before = Sum::default().plus_scaled(time, -1);
        let is_early = before
            .greatest(intervals)
            .is_none_or(|own| own.is_positive());
        if is_early || (point == 0 && !is_zero) {
            return Err(Flaw::BeforeTimeZero(point));
        }
    }
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        let (from, to) = (&times[constraint.from], &times[constraint.to]);
        for (limit, sign) in [(&constraint.upper, 1), (&constraint.lower, -1)] {
            let sum = Sum::default()
                .plus_scaled(to, sign)
                .plus_scaled(from, -sign);
            let Some(sum) = sum.minus_limit(limit, sign) else {
                continue;
            };
            if sum.greatest(intervals).is_none_or(|own| own.is_positive()) {
                return Err(Flaw::ConstraintViolated(index));
            }
        }
    }
    Ok(())
}

/// `constant + Σ factor · value`.
#[derive(Default)]
struct Sum {
    constant: Rational,
    factors: BTreeMap<usize, Rational>,
}

impl Sum {
    fn plus_scaled(mut self, other: &Affine, sign: i64) -> Self {
        let sign = Rational::from(sign);
        self.constant += &other.constant * &sign;
        for own in &other.parameters {
            *self.factors.entry(own.parameter).or_default() += &own.factor * &sign;
        }
        self
    }

    /// Subtracts `sign` times a limit. Returns `None` if there is no limit.
    fn minus_limit(mut self, limit: &Limit, sign: i64) -> Option<Self> {
        match limit {
            Limit::None => return None,
            Limit::Number(number) => self.constant -= &number.0 * &Rational::from(sign),
            Limit::Parameter(parameter) => {
                *self.factors.entry(*parameter).or_default() -= Rational::from(sign);
            }
        }
        Some(self)
    }

    fn greatest(&self, intervals: &Intervals) -> Option<Rational> {
        let factors = self
            .factors
            .iter()
            .map(|(parameter, factor)| (*parameter, factor));
        intervals.greatest(self.constant.clone(), factors)
    }
}
