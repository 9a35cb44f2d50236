//! From a plan with fixed times to its envelope: the figure in ARCHITECTURE.md, left to right.

use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan};

pub use elbowroom_envelope::pipeline::{
    PipelineError, deorder_and_open, deorder_or_reschedule, free, open, open_more_quantities,
    reschedule, validate_plan, without_parameters,
};
pub use elbowroom_selection::EnvelopeSettings as Settings;

use crate::answers::envelope::envelope;
use crate::answers::{EnvelopeOutcome, EnvelopeRequest, NoObserver, RequestError};

/// Computes the envelope of a plan with fixed times.
///
/// Equals [`answers::envelope::envelope`](crate::answers::envelope::envelope) without a watcher.
///
/// # Errors
/// When `settings.vary` names quantities that the plan does not have, and when the plan is beyond exact
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
