//! Fixed times, for the strong guarantee.
//!
//! A point that the world decides follows a point that the executor schedules; the durations
//! between them separate the two. Each bound has to hold for the worst case of the durations that
//! precede only one of its points.

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Constraint, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;
use crate::network::{duration, ended_by};
use crate::number::Exact;

/// Checks that these times satisfy all constraints for all values in the box.
///
/// # Errors
/// The first bound that they do not satisfy.
pub(super) fn check(
    certificate: &Certificate,
    intervals: &Intervals,
    times: &[Option<Exact>],
) -> Result<(), Flaw> {
    let points = certificate.points.len();
    if times.len() != points {
        return Err(Flaw::Count {
            what: "times",
            found: times.len(),
            wanted: points,
        });
    }
    let ended_by = ended_by(certificate);
    for (point, time) in times.iter().enumerate() {
        let is_observed = ended_by[point].is_some();
        if time.is_some() == is_observed {
            return Err(Flaw::NotChosen(point));
        }
        let is_zero = time.as_ref().is_some_and(|time| time.0.is_zero());
        let is_early = time.as_ref().is_some_and(|time| time.0.is_negative());
        if is_early || (point == 0 && !is_zero) {
            return Err(Flaw::BeforeTimeZero(point));
        }
    }
    let schedule = Times {
        certificate,
        intervals,
        scheduled: times,
        ended_by: &ended_by,
    };
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        if constraint.observed {
            duration(certificate, intervals, index)?;
            continue;
        }
        let Constraint { from, to, .. } = *constraint;
        let broken = || Flaw::ConstraintViolated(index);
        // An upper bound counts with its least value, a lower bound with its greatest value.
        if let Some(most) = limit(&constraint.upper, intervals, false, index)? {
            let difference = schedule.greatest(from, to)?.ok_or_else(broken)?;
            (difference <= most).then_some(()).ok_or_else(broken)?;
        }
        if let Some(least) = limit(&constraint.lower, intervals, true, index)? {
            let difference = schedule.greatest(to, from)?.ok_or_else(broken)?;
            (difference <= -&least).then_some(()).ok_or_else(broken)?;
        }
    }
    Ok(())
}

/// Returns the value of a limit that has to hold for all values of its parameter; `None` if there
/// is no limit.
pub(super) fn limit(
    limit: &Limit,
    intervals: &Intervals,
    is_lower: bool,
    constraint: usize,
) -> Result<Option<Rational>, Flaw> {
    match limit {
        Limit::None => Ok(None),
        Limit::Number(number) => Ok(Some(number.0.clone())),
        Limit::Parameter(parameter) => {
            let end = &intervals.of(*parameter)?[usize::from(is_lower)];
            end.clone()
                .map(Some)
                .ok_or(Flaw::ConstraintViolated(constraint))
        }
    }
}

struct Times<'a> {
    certificate: &'a Certificate,
    intervals: &'a Intervals,
    scheduled: &'a [Option<Exact>],
    ended_by: &'a [Option<usize>],
}

impl Times<'_> {
    /// Returns the latest preceding point that the executor schedules (or `point` itself), and the
    /// durations from there to `point`.
    fn chain(&self, mut point: usize) -> (usize, Vec<usize>) {
        let mut links = Vec::new();
        while let Some(link) = self.ended_by[point] {
            links.push(link);
            point = self.certificate.constraints[link].from;
        }
        links.reverse();
        (point, links)
    }

    /// Returns the greatest difference of the times of two points; `None` if it is unbounded.
    fn greatest(&self, from: usize, to: usize) -> Result<Option<Rational>, Flaw> {
        let ((from, before), (to, after)) = (self.chain(from), self.chain(to));
        let time = |point: usize| {
            let time = self.scheduled[point].as_ref();
            time.ok_or(Flaw::NotChosen(point))
        };
        let mut difference = &time(to)?.0 - &time(from)?.0;
        let pairs = before.iter().zip(&after);
        let shared = pairs.take_while(|(one, other)| one == other).count();
        for &link in &before[shared..] {
            difference -= &duration(self.certificate, self.intervals, link)?.0;
        }
        for &link in &after[shared..] {
            match duration(self.certificate, self.intervals, link)?.1 {
                Some(greatest) => difference += &greatest,
                None => return Ok(None),
            }
        }
        Ok(Some(difference))
    }
}
