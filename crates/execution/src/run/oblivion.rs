//! Bounds on the memory of an executive, so that it does not grow with the length of the run.

use super::{Run, Verdict};

/// Number of ended starts that are kept, for late reports and for the report of the run.
const MOST_STARTS: usize = 2000;

/// Number of events that are kept for [`Run::dead_end`]. If an earlier event made a goal
/// unreachable, the explanation says that the goal was never reachable.
const MOST_EVENTS: usize = 1000;

impl Run<'_> {
    /// Forgets the distant past of an executive. To be called now and then.
    pub(super) fn forget_the_past(&mut self) {
        if !self.goes_on_after(&Verdict::GoalReached) {
            return;
        }
        // Only at twice the limit, so that it rarely happens.
        if self.history.len() >= 2 * MOST_EVENTS {
            let past = self.history.len() - MOST_EVENTS;
            self.beginning = self.believed_after(past);
            self.history.drain(..past);
        }
        if self.reasons.len() >= 2 * MOST_EVENTS {
            self.reasons.drain(..MOST_EVENTS);
        }
        self.account.forget(MOST_STARTS);
    }
}
