//! Bounds on the memory of an executive, so that it does not grow with the length of the run.

use super::{Run, Verdict};

/// Number of ended starts that are kept, for late reports and for the report of the run.
const MAX_STARTS: usize = 2000;

/// Number of events that are kept for [`Run::dead_end`]. If an earlier event made a goal
/// unreachable, the explanation says that the goal was never reachable.
const MAX_EVENTS: usize = 1000;

impl Run<'_> {
    /// Forgets the distant past of an executive. To be called now and then.
    pub(super) fn prune_history(&mut self) {
        if !self.becomes_idle_after(&Verdict::GoalReached) {
            return;
        }
        // Only at twice the limit, so that it rarely happens.
        if self.history.len() >= 2 * MAX_EVENTS {
            let past = self.history.len() - MAX_EVENTS;
            self.initial_belief = self.believed_after(past);
            self.history.drain(..past);
        }
        if self.reasons.len() >= 2 * MAX_EVENTS {
            self.reasons.drain(..MAX_EVENTS);
        }
        self.action_log.forget_earliest(MAX_STARTS);
    }
}
