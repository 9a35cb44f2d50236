//! Actions whose end is decided from outside.

use elbowroom_execution::Ticket;

use super::{Coming, SimWorld};

impl SimWorld<'_> {
    /// Keeps a running action from ending by itself; it ends when it is [let go](Self::let_go).
    /// Returns `true` if the action is running and was going to end. An action that is going to
    /// fail is not affected.
    pub fn hold(&mut self, ticket: Ticket) -> bool {
        let count = self.agenda.len();
        self.agenda
            .retain(|_, coming| !matches!(coming, Coming::End(own) if *own == ticket));
        self.agenda.len() < count
    }

    /// Ends a held action now, when the world is next asked to wait.
    pub fn let_go(&mut self, ticket: Ticket) {
        if self.actions.get(&ticket).is_some_and(|own| own.has_started) {
            self.put(self.now.clone(), Coming::End(ticket));
        }
    }
}
