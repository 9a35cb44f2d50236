//! World in the process of its executive.

use elbowroom::execution::{ActionHandle, TimeAdvance, World, WorldError};
use elbowroom::num::Rational;

/// World that is an object in the process of its executive, instead of a simulation or a separate
/// process.
///
/// After a crash, a new object takes its place and reports the outcomes of the actions that were
/// running.
pub trait EmbeddedWorld: World {
    /// Returns the present time, and `started` or `ended` for each of these actions whose outcome is known. Called once,
    /// before anything else, when a run is resumed from its journal. `now` is the time of the last record.
    ///
    /// Actions that are not reported have failed, and are cancelled. `None` means that the world knows nothing of the
    /// earlier process: its clock restarts, and all of these actions have failed. They are not cancelled, as the new
    /// object has not started them: nothing of them may be running.
    ///
    /// # Errors
    /// When the world fails.
    fn recall(
        &mut self,
        now: &Rational,
        running: &[StartedAction],
    ) -> Result<Option<TimeAdvance>, WorldError> {
        let _ = (now, running);
        Ok(None)
    }
}

/// Action that an earlier process has commanded to start, and whose end is not in the journal.
#[derive(Clone, Debug, PartialEq)]
pub struct StartedAction {
    /// Ticket of its start.
    pub ticket: ActionHandle,
    /// The action in PDDL: `(drive rover depot shelf)`.
    pub action: String,
    /// Planned duration; `None` for an instantaneous action.
    pub duration: Option<Rational>,
    /// Time at which it was commanded to start.
    pub ordered: Rational,
}
