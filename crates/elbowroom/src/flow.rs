//! From a plan with fixed times to the deviations it survives: the figure in ARCHITECTURE.md,
//! left to right.

use std::sync::Arc;

use elbowroom_envelope::obligations::Refusal;
use elbowroom_envelope::{Guarantee, Objective};
use elbowroom_model::validate::{self, Verdict};
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_plan::deorder::{DeorderError, Deordered, deorder, deorder_the_plan_alone};
use elbowroom_plan::parametrize::{ParametrizeError, VarySpec, parametrize, vary};
use elbowroom_plan::{NodeId, ParametrizedPlan};
use elbowroom_sim::WorldModel;
use elbowroom_stn::ConsistentNetwork;

use crate::answers::envelope::{Search, envelope};
use crate::answers::{EnvelopeOutcome, EnvelopeRequest, RequestError, Unwatched};
use crate::room;

/// The quantities to vary, and the parameters of the search.
#[derive(Clone, Debug)]
pub struct Settings {
    /// What to leave open; all durations that the domain fixes if empty.
    pub vary: Vec<VarySpec>,
    /// The guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// How to search.
    pub search: elbowroom_envelope::Settings,
    /// What the box is to be the best of; without one, it is IRR's.
    pub objective: Option<Objective>,
    /// The world in which durations are to stay inside most likely, with
    /// [`Objective::Probability`].
    pub world: Option<Arc<WorldModel>>,
}

impl Default for Settings {
    /// All durations that the domain fixes, the dynamic guarantee, precision a hundredth of each
    /// nominal value.
    fn default() -> Self {
        Self {
            vary: Vec::new(),
            guarantee: Guarantee::default(),
            search: Search::default().settings(),
            objective: None,
            world: None,
        }
    }
}

/// A plan that leaves no room to compute with.
#[derive(Debug, thiserror::Error)]
pub enum FlowError {
    /// The judge rejects the plan.
    #[error("the plan is not valid: {0}")]
    Invalid(Box<validate::Violation>),
    /// The plan has no order.
    #[error(transparent)]
    Deorder(#[from] DeorderError),
    /// Something cannot be left open.
    #[error(transparent)]
    Parametrize(#[from] ParametrizeError),
    /// The plan is beyond exact analysis.
    #[error("this plan is beyond what can be analysed exactly: {0}")]
    Refused(#[from] Refusal),
}

/// From a plan with fixed times to the deviations it survives.
///
/// The same as [`answers::envelope::envelope`](crate::answers::envelope::envelope) with nobody
/// watching.
///
/// # Errors
/// When `settings.vary` names what the plan does not have, and when the plan is beyond exact
/// analysis. That the plan does not work is an answer.
pub fn robust_plan(
    task: &Arc<Task>,
    time_triggered: &TimeTriggeredPlan,
    settings: &Settings,
) -> Result<EnvelopeOutcome, RequestError> {
    let plan = time_triggered.clone();
    let request = EnvelopeRequest::new(task, plan).with_settings(settings);
    envelope(&request, &mut Unwatched)
}

/// A plan with only the orderings and bounds that it needs.
#[derive(Clone, Debug)]
pub struct Freed {
    /// The plan, and a schedule of it.
    pub deordered: Deordered,
    /// What the judge objects to in the times of the original plan, if the schedule is not the
    /// original one but close to it.
    pub repaired: Option<Box<validate::Violation>>,
}

/// The plan with only the orderings and bounds that it needs.
///
/// Planners round their times, and the judge forgives nothing. If it rejects the plan, but the
/// plan's order leaves a schedule that it accepts, that schedule is taken in place of the plan's.
///
/// # Errors
/// When the judge rejects the plan.
pub fn free(task: &Task, time_triggered: &TimeTriggeredPlan) -> Result<Freed, FlowError> {
    let Verdict::Invalid(violation) = judge(task, time_triggered) else {
        return Ok(Freed {
            deordered: deorder(task, time_triggered)?,
            repaired: None,
        });
    };
    let violation = Box::new(violation);
    let works = |d: &Deordered| judge(task, &d.plan.scheduled(&d.nominal)).is_valid();
    match deorder(task, time_triggered) {
        Ok(deordered) if works(&deordered) => Ok(Freed {
            deordered,
            repaired: Some(violation),
        }),
        _ => Err(FlowError::Invalid(violation)),
    }
}

/// [`free`], and the quantities left open as by [`open`], also of a plan with processes and events:
/// all its happenings keep their order then, and the times between them are kept near the plan's
/// own as far as it takes for processes and events to do in every schedule what they do in the
/// plan.
///
/// # Errors
/// When the judge rejects the plan, and when `specs` names what the plan does not have.
pub(crate) fn free_and_open(
    task: &Task,
    time_triggered: &TimeTriggeredPlan,
    specs: &[VarySpec],
    repaired: &mut dyn FnMut(&validate::Violation),
) -> Result<ParametrizedPlan, FlowError> {
    if task.autonomous().is_empty() {
        let freed = free(task, time_triggered)?;
        if let Some(violation) = &freed.repaired {
            repaired(violation);
        }
        return open(task, freed, specs);
    }
    if let Verdict::Invalid(violation) = judge(task, time_triggered) {
        return Err(FlowError::Invalid(Box::new(violation)));
    }
    let Deordered { plan, nominal, .. } = deorder_the_plan_alone(task, time_triggered)?;
    let plan = parametrize(task, plan, &nominal, specs)?;
    Ok(room::in_order(task, plan, &nominal))
}

/// A plan like the one given, with other times, if the judge rejects it but accepts those: what
/// [`external`](elbowroom_external) asks for where a planner's times are rounded.
pub fn repaired(task: &Task, time_triggered: &TimeTriggeredPlan) -> Option<TimeTriggeredPlan> {
    let freed = free(task, time_triggered).ok()?;
    let Deordered { plan, nominal, .. } = freed.deordered;
    Some(plan.scheduled(&nominal))
}

/// The plan with quantities left open; all durations, if nothing is specified. Where needed,
/// differences of times are kept near the plan's own so that every schedule works as long as these
/// quantities keep their nominal values.
///
/// # Errors
/// When `specs` names what the plan does not have.
pub fn open(task: &Task, freed: Freed, specs: &[VarySpec]) -> Result<ParametrizedPlan, FlowError> {
    let Deordered { plan, nominal, .. } = freed.deordered;
    let plan = parametrize(task, plan, &nominal, specs)?;
    Ok(room::of_deordered(task, plan, &nominal))
}

/// The plan with nothing left open. Where needed, differences of times are kept near the plan's own
/// so that every schedule works.
pub fn closed(task: &Task, freed: Freed) -> ParametrizedPlan {
    let Deordered { plan, nominal, .. } = freed.deordered;
    let plan = ParametrizedPlan::closed(task, plan);
    room::of_deordered(task, plan, &nominal)
}

/// An STN plan, which may have parameters already, with more left open.
///
/// # Errors
/// When `specs` names what the plan does not have.
pub fn open_more(
    task: &Task,
    plan: ParametrizedPlan,
    specs: &[VarySpec],
) -> Result<ParametrizedPlan, ParametrizeError> {
    if specs.is_empty() {
        return Ok(plan);
    }
    let network = plan.plan.network(&plan.nominal());
    // Without a schedule there is no answer either, which will be said with its reason.
    let Ok(network) = ConsistentNetwork::try_from(network) else {
        return Ok(plan);
    };
    let schedule = network.earliest_schedule(elbowroom_plan::network_node(NodeId::ZERO));
    vary(task, plan, &schedule.into(), specs)
}

/// The judge's verdict on a plan.
pub(crate) fn judge(task: &Task, plan: &TimeTriggeredPlan) -> Verdict {
    validate::validate(task, plan, &validate::Settings::default())
}
