//! The end of a run: nothing is left running.

use elbowroom_num::Rational;

use super::{Run, Stop, Verdict};
use crate::event::Ticket;
use crate::record::Entry;

/// How many seconds of the world's time cancelled actions have to stop when a run ends.
pub const FAREWELL: i64 = 5;

impl Run<'_> {
    /// Whether somebody wants the run to end.
    pub(super) fn heed(&mut self) -> Result<(), Stop> {
        if !self.is_to_end.is_some_and(|is_to_end| is_to_end()) {
            return Ok(());
        }
        self.ports
            .recorder
            .record(&Entry::Interrupted { now: &self.now });
        Err(Stop::Over(Verdict::Interrupted))
    }

    /// Cancels what has not ended, and waits a moment for it to stop. A world that fails meanwhile
    /// changes nothing any more.
    pub(super) fn leave_nothing_running(&mut self) {
        let open: Vec<Ticket> = self.account.open_tickets().collect();
        if open.is_empty() {
            return;
        }
        for ticket in open {
            if !self.account.is_cancelled(ticket) && self.cancel(ticket).is_err() {
                return;
            }
        }
        let last = &self.now + Rational::from(FAREWELL);
        // What stops at once is told at once.
        let mut until = self.now.clone();
        self.progress.begin_plan();
        while self.account.open_tickets().next().is_some() {
            let Ok(passage) = self.ports.world.wait(&until) else {
                return;
            };
            self.take_up_passage(&until, passage);
            let moves_on = self.progress.note(&self.now, self.steps);
            if self.now >= last || moves_on.is_err() {
                return;
            }
            until.clone_from(&last);
        }
    }
}
