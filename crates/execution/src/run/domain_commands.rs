//! Commands with the durations of the domain, where plans have other ones.

use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_num::Rational;

use super::Run;

impl Run<'_> {
    /// Gives commands the durations that the domain fixes, where the task has expected durations in their place
    /// ([`elbowroom_model::problem::ExpectedDurations`]). So the world, the validator, and what is learnt from the
    /// record do not depend on what is expected.
    #[must_use]
    pub fn with_domain_commands(mut self) -> Self {
        self.domain = Some(Arc::new(self.task.with_domain_durations()));
        self
    }

    /// Returns an action to be started, and its duration, as in the domain.
    pub(super) fn in_domain(
        &self,
        action: Arc<Action>,
        duration: Option<Rational>,
    ) -> (Arc<Action>, Option<Rational>) {
        let domain = self.domain.as_ref();
        let own =
            domain.and_then(|domain| domain.instantiate(action.schema, &action.arguments).ok());
        let Some(own) = own.filter(|own| *own != *action) else {
            return (action, duration);
        };
        let fixed = match own.durative().map(|body| body.duration.as_slice()) {
            Some([only]) => self.belief.value_of(&only.bound),
            _ => None,
        };
        (Arc::new(own), fixed.or(duration))
    }
}
