//! What a lasting run forgets, so that it takes no more memory after a month than after an hour.

use super::{Run, Verdict};

/// So many starts are known after they have ended: late reports on them are understood, and the
/// report of the run has them.
const MOST_STARTS: usize = 2000;

/// So many events are known when there is no way on: what took a goal out of reach before them has
/// always been so, for [`Run::dead_end`].
const MOST_EVENTS: usize = 1000;

impl Run<'_> {
    /// Forgets what is long past, if the run is one that goes on. To be called now and then.
    pub(super) fn forget_the_past(&mut self) {
        if !self.goes_on_after(&Verdict::GoalReached) {
            return;
        }
        // Twice as much before anything is done, so that it is seldom done.
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
