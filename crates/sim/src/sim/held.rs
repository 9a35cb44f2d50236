//! Actions whose end is left to somebody else.

use elbowroom_execution::Ticket;

use super::{Coming, SimWorld};

impl SimWorld<'_> {
    /// An action that is under way does not end by itself any more, but when it is
    /// [let go](Self::let_go). Whether it is under way, and was going to end: an action that will
    /// fail does so when the model says.
    pub fn hold(&mut self, ticket: Ticket) -> bool {
        let count = self.agenda.len();
        self.agenda
            .retain(|_, coming| !matches!(coming, Coming::End(own) if *own == ticket));
        self.agenda.len() < count
    }

    /// An action that was held ends now, as soon as time is let pass.
    pub fn let_go(&mut self, ticket: Ticket) {
        if self.actions.get(&ticket).is_some_and(|own| own.has_started) {
            self.put(self.now.clone(), Coming::End(ticket));
        }
    }
}
