//! Actions whose end is decided from outside.

use elbowroom_execution::ActionHandle;

use super::{ComingEvent, SimWorld};

impl SimWorld<'_> {
    /// Keeps a running action from ending by itself; it ends when it is [let go](Self::release).
    /// Returns `true` if the action is running and was going to end. An action that is going to
    /// fail is not affected.
    pub fn hold(&mut self, ticket: ActionHandle) -> bool {
        let count = self.agenda.len();
        self.agenda
            .retain(|_, coming| !matches!(coming, ComingEvent::End(own) if *own == ticket));
        self.agenda.len() < count
    }

    /// Ends a held action now, when the world is next asked to wait.
    pub fn release(&mut self, ticket: ActionHandle) {
        if self.actions.get(&ticket).is_some_and(|own| own.has_started) {
            self.schedule(self.now.clone(), ComingEvent::End(ticket));
        }
    }
}
