//! Obligations that a dispatcher can enforce.

use elbowroom_model::Task;
use elbowroom_plan::{Bound, Constraint, DecoupledEnvelope, ParametrizedPlan, Reason};
use elbowroom_stn::{ConsistentNetwork, Weight};

use crate::obligations::{BadCase, Difference, Obligations, Refusal};
use crate::reduction::Reduction;
use crate::soundness::earliest_schedule;

/// Adds constraints to the plan for all obligations that are bounds on the difference of two times.
/// Also returns the number of these that the plan's network does not already imply.
///
/// Paper 1 requires that *every* schedule of the plan is valid, including those that a dispatcher
/// would never choose. If validity depends on a bound on the difference of two times, the
/// dispatcher can enforce the bound. The remaining question is whether it is able to.
///
/// # Errors
/// If the plan has no schedule at its nominal values, or contains something beyond exact linear
/// reasoning.
pub fn with_obligations(
    task: &Task,
    plan: &ParametrizedPlan,
) -> Result<(ParametrizedPlan, usize), Refusal> {
    let reduction = Reduction::new(plan);
    let nominal = plan.nominal();
    let schedule = earliest_schedule(&reduction, &nominal).ok_or(Refusal::NoNominalSchedule)?;
    let obligations =
        Obligations::compile(task, plan, (&schedule, &nominal), &reduction.substitution)?;
    let ranges = DecoupledEnvelope::ranges(plan);
    let network = ConsistentNetwork::try_from(reduction.network(&ranges).network).ok();
    let is_implied = |wanted: &Difference| {
        let Some(network) = &network else {
            return false;
        };
        let (from, from_offset) = reduction.class_of(wanted.from);
        let (to, to_offset) = reduction.class_of(wanted.to);
        // `from - to <= distance`, so that `to - from >= -distance`.
        let distance = network.distance(to, from);
        distance.is_some_and(|distance| {
            let least = distance.negated().real + to_offset - from_offset;
            least >= wanted.bound
        })
    };
    let mut enforced = plan.clone();
    let direct = obligations
        .direct
        .iter()
        .flat_map(|obligation| &obligation.bad_cases);
    for difference in direct.filter_map(avoidable) {
        if is_implied(difference) {
            continue;
        }
        let constraint = Constraint {
            from: difference.from,
            to: difference.to,
            lower: Bound::Finite(difference.bound.clone()),
            upper: Bound::Infinite,
            reason: Reason::Interference,
        };
        if !enforced.plan.constraints.contains(&constraint) {
            enforced.plan.constraints.push(constraint);
        }
    }
    let added = enforced.plan.constraints.len() - plan.plan.constraints.len();
    Ok((enforced, added))
}

/// Returns the difference that is too small in a bad case, if the case has no other constraints.
fn avoidable(case: &BadCase) -> Option<&Difference> {
    match (case.differences.as_slice(), case.inequalities.as_slice()) {
        ([difference], []) if difference.is_strict => Some(difference),
        _ => None,
    }
}
