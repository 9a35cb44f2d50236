//! That a certificate's constraints are a network with durations that the world decides on.

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Constraint, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;

/// For each point the observed constraint that ends there, in a certificate that
/// [is well formed](is_well_formed).
pub(crate) fn ended_by(certificate: &Certificate) -> Vec<Option<usize>> {
    let mut ended_by = vec![None; certificate.points.len()];
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        if constraint.observed {
            ended_by[constraint.to] = Some(index);
        }
    }
    ended_by
}

/// The least and the greatest value in the box of an observed difference; `None` is infinite.
///
/// # Errors
/// When it is no duration: it may be negative, or has not one parameter for both its bounds.
pub(crate) fn duration(
    certificate: &Certificate,
    intervals: &Intervals,
    index: usize,
) -> Result<(Rational, Option<Rational>), Flaw> {
    let constraint = &certificate.constraints[index];
    let parameter = match (&constraint.lower, &constraint.upper) {
        (Limit::Parameter(lower), Limit::Parameter(upper)) if lower == upper => *lower,
        _ => return Err(Flaw::NotObserved(index)),
    };
    let [least, greatest] = intervals.of(parameter)?;
    let least = least.clone().filter(|least| !least.is_negative());
    Ok((least.ok_or(Flaw::NotObserved(index))?, greatest.clone()))
}

/// Checks that constraints are about points that there are, and that observed ones are durations:
/// each leads to a point of its own, not to time zero, and they follow each other in no circle. The
/// theorems about such networks take that for granted.
///
/// # Errors
/// The first constraint that is not so.
pub(crate) fn is_well_formed(certificate: &Certificate) -> Result<(), Flaw> {
    let points = certificate.points.len();
    // Of each point the observed constraint that ends there.
    let mut ended_by: Vec<Option<usize>> = vec![None; points];
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        let &Constraint { from, to, .. } = constraint;
        if from >= points || to >= points {
            return Err(Flaw::Range("constraint", index));
        }
        if constraint.observed && (to == 0 || ended_by[to].replace(index).is_some()) {
            return Err(Flaw::NoDuration(index));
        }
    }
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        if !constraint.observed {
            continue;
        }
        let mut point = constraint.from;
        let mut before = 0;
        while let Some(earlier) = ended_by[point] {
            before += 1;
            if before > points {
                return Err(Flaw::NoDuration(index));
            }
            point = certificate.constraints[earlier].from;
        }
    }
    Ok(())
}
