//! From a plan with fixed times to its envelope: the figure in ARCHITECTURE.md, left to right.

use std::sync::Arc;

use elbowroom_envelope::Guarantee;
use elbowroom_execution::run::TimeoutRule;
use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_plan::parametrize::VarySpec;
use elbowroom_sim::WorldModel;

pub use elbowroom_envelope::pipeline::{
    PipelineError, deorder_and_open, deorder_or_reschedule, free, open, open_more_quantities,
    reschedule, validate_plan, without_parameters,
};

use crate::answers::envelope::{Search, envelope};
use crate::answers::{EnvelopeOutcome, EnvelopeRequest, NoObserver, RequestError};

/// The quantities to vary, and the settings of the search.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Quantities to leave open; if empty, all durations that the domain fixes.
    pub vary: Vec<VarySpec>,
    /// The guarantee inside the envelope.
    pub guarantee: Guarantee,
    /// The rule that sets the time-out of each action.
    pub timeout: TimeoutRule,
    /// Settings of the search for the box.
    pub search: Search,
    /// World whose distributions of durations
    /// [`Objective::Probability`](elbowroom_envelope::Objective::Probability) uses.
    pub world: Option<Arc<WorldModel>>,
}

impl Default for Settings {
    /// Returns settings with all durations open that the domain fixes, the dynamic guarantee, and
    /// the default search.
    fn default() -> Self {
        Self {
            vary: Vec::new(),
            guarantee: Guarantee::default(),
            timeout: TimeoutRule::default(),
            search: Search::default(),
            world: None,
        }
    }
}

/// Computes the envelope of a plan with fixed times.
///
/// Equals [`answers::envelope::envelope`](crate::answers::envelope::envelope) without a watcher.
///
/// # Errors
/// When `settings.vary` names things that the plan does not have, and when the plan is beyond exact
/// analysis. A plan that does not work is an answer, not an error.
pub fn robust_plan(
    task: &Arc<Task>,
    time_triggered: &TimeTriggeredPlan,
    settings: &Settings,
) -> Result<EnvelopeOutcome, RequestError> {
    let plan = time_triggered.clone();
    let request = EnvelopeRequest::new(task, plan).with_settings(settings);
    envelope(&request, &mut NoObserver)
}
