//! Copies of a status, for simulations, and the slack of its plan.

use std::sync::{Arc, Mutex};

use elbowroom::execution::BeliefState;
use elbowroom::num::Rational;

use super::{RUNNING, Status, TO_COME};

impl Status {
    /// Returns a copy that does not follow the run any more.
    pub(crate) fn fork(&self) -> Self {
        let copy = self.lock().clone();
        Self(Arc::new(Mutex::new(copy)))
    }

    /// Returns the belief state at the last entry of the record.
    pub(crate) fn belief(&self) -> Option<Arc<BeliefState>> {
        self.lock().belief.clone()
    }

    /// Returns the least slack of an action that is running or to come and whose duration has an upper limit: the part
    /// of this limit that is left, from 0 to 1, beyond the planned duration, or the present one if that is longer.
    pub fn least_slack(&self) -> Option<Rational> {
        let rooms = self.guarantee().parameters;
        let known = self.lock();
        let steps = known.steps.iter();
        let left = steps.filter(|step| [TO_COME, RUNNING].contains(&step.state.as_str()));
        let slacks = left.filter_map(|step| {
            let name = step.parameter.as_ref()?;
            let room = rooms.iter().find(|room| room.name == *name)?;
            let most = room.most.as_ref()?.0.value()?;
            let running = step.ticket.and_then(|ticket| known.running.get(&ticket));
            let spent = running
                .map(|it| &known.now - &it.since.0)
                .unwrap_or_default();
            let left = most - spent.max(room.nominal.0.clone());
            left.max(Rational::ZERO).checked_div(most)
        });
        slacks.min()
    }
}
