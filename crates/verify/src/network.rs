//! Check that a certificate's constraints form a network with observed durations.

use elbowroom_num::Rational;

use crate::certificate::{Certificate, Constraint, Limit};
use crate::flaw::Flaw;
use crate::intervals::Intervals;

/// Returns, for each point, the observed constraint that ends there. The certificate has to be
/// [well formed](is_well_formed).
pub(crate) fn ended_by(certificate: &Certificate) -> Vec<Option<usize>> {
    let mut ended_by = vec![None; certificate.points.len()];
    for (index, constraint) in certificate.constraints.iter().enumerate() {
        if constraint.observed {
            ended_by[constraint.to] = Some(index);
        }
    }
    ended_by
}

/// Returns the least and the greatest value in the box of an observed difference; `None` is
/// infinite.
///
/// # Errors
/// When it is not a duration: it may be negative, or its bounds are not the same parameter.
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

/// Checks that constraints refer to existing points, and that observed constraints are durations:
/// each ends at a separate point, not at time zero, and they form no cycle. The theorems about such
/// networks assume these properties.
///
/// # Errors
/// The first constraint that violates them.
pub(crate) fn is_well_formed(certificate: &Certificate) -> Result<(), Flaw> {
    let points = certificate.points.len();
    // For each point the observed constraint that ends there.
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
