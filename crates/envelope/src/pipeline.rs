//! From a plan with fixed times to a network with open quantities: deordering, parameters, pinning.

use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_plan::deorder::{DeorderError, Deordered, deorder, deorder_ignoring_processes};
use elbowroom_plan::parametrize::{ParametrizeError, VarySpec, parametrize, vary};
use elbowroom_plan::{NodeId, ParametrizedPlan};
use elbowroom_stn::ConsistentNetwork;

use crate::obligations::Refusal;
use crate::pinning;

/// Reasons why a plan has no envelope.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// The validator rejects the plan.
    #[error("the plan is not valid: {0}")]
    Invalid(Box<validate::Violation>),
    /// The plan has no order.
    #[error(transparent)]
    Deorder(#[from] DeorderError),
    /// A quantity cannot be left open.
    #[error(transparent)]
    Parametrize(#[from] ParametrizeError),
    /// The plan is beyond exact analysis.
    #[error("this plan cannot be analysed exactly: {0}")]
    Refused(#[from] Refusal),
}

/// Returns the plan with only the orderings and bounds that it needs, and a schedule of it.
///
/// # Errors
/// When the validator rejects the plan. [`RoundingRule`](crate::RoundingRule) reads plans with
/// rounded numbers.
pub fn free(task: &Task, time_triggered: &TimeTriggeredPlan) -> Result<Deordered, PipelineError> {
    if let Verdict::Invalid(violation) = validate_plan(task, time_triggered) {
        return Err(PipelineError::Invalid(Box::new(violation)));
    }
    Ok(deorder(task, time_triggered)?)
}

/// Does the same as [`free`] and [`open`], but also for plans with processes and events. All
/// happenings of such a plan keep their order. The times between them stay close enough to the
/// plan's own that processes and events take the same course in every schedule.
///
/// # Errors
/// When the validator rejects the plan, and when `specs` names quantities that the plan does not have.
pub fn deorder_and_open(
    task: &Task,
    time_triggered: &TimeTriggeredPlan,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, PipelineError> {
    if task.autonomous().is_empty() {
        return open(task, free(task, time_triggered)?, specs);
    }
    if let Verdict::Invalid(violation) = validate_plan(task, time_triggered) {
        return Err(PipelineError::Invalid(Box::new(violation)));
    }
    let Deordered { plan, nominal, .. } = deorder_ignoring_processes(task, time_triggered)?;
    let plan = parametrize(task, plan, &nominal, specs)?;
    Ok(pinning::pin_in_order(task, plan, &nominal))
}

/// Does the same as [`free`] for plans whose own times may be outdated, such as a remaining plan
/// that is executed late. If the validator rejects these times, but accepts other times in the same
/// order, the schedule has those.
///
/// # Errors
/// When the validator rejects the plan.
pub fn deorder_or_reschedule(
    task: &Task,
    time_triggered: &TimeTriggeredPlan,
) -> Result<Deordered, PipelineError> {
    let invalid = match free(task, time_triggered) {
        Err(PipelineError::Invalid(violation)) => PipelineError::Invalid(violation),
        other => return other,
    };
    let works = |d: &Deordered| validate_plan(task, &d.plan.scheduled(&d.nominal)).is_valid();
    match deorder(task, time_triggered) {
        Ok(deordered) if works(&deordered) => Ok(deordered),
        _ => Err(invalid),
    }
}

/// Returns the plan in the same order with other times, if the validator accepts it. It is the
/// fallback of programs that run other planners, for plans with invalid times.
pub fn reschedule(task: &Task, time_triggered: &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> {
    let Deordered { plan, nominal, .. } = deorder_or_reschedule(task, time_triggered).ok()?;
    Some(plan.scheduled(&nominal))
}

/// Returns the plan with quantities left open; all durations, if nothing is specified. Where
/// needed, differences of times are kept close enough to the plan's own that every schedule works
/// as long as these quantities keep their nominal values.
///
/// # Errors
/// When `specs` names quantities that the plan does not have.
pub fn open(
    task: &Task,
    freed: Deordered,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, PipelineError> {
    let Deordered { plan, nominal, .. } = freed;
    let plan = parametrize(task, plan, &nominal, specs)?;
    Ok(pinning::pin_deordered(task, plan, &nominal))
}

/// Returns the plan without open quantities. Where needed, differences of times are kept close
/// enough to the plan's own that every schedule works.
pub fn without_parameters(task: &Task, freed: Deordered) -> ParametrizedPlan {
    let Deordered { plan, nominal, .. } = freed;
    let plan = ParametrizedPlan::closed(task, plan);
    pinning::pin_deordered(task, plan, &nominal)
}

/// Opens further quantities of an STN plan.
///
/// # Errors
/// When `specs` names quantities that the plan does not have.
pub fn open_more_quantities(
    task: &Task,
    plan: ParametrizedPlan,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, ParametrizeError> {
    if specs.is_empty() {
        return Ok(plan);
    }
    let network = plan.plan.network(&plan.nominal());
    // The analysis reports the reason for a missing schedule later.
    let Ok(network) = ConsistentNetwork::try_from(network) else {
        return Ok(plan);
    };
    let schedule = network.earliest_schedule(elbowroom_plan::network_node(NodeId::ZERO));
    vary(task, plan, &schedule.into(), specs)
}

/// Returns the validator's verdict on a plan.
pub fn validate_plan(task: &Task, plan: &TimeTriggeredPlan) -> Verdict {
    validate::validate(task, plan, &validate::Settings::default())
}
