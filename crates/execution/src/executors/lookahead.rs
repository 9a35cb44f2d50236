//! `lookahead`: what is best in the world of the likelihoods, on a clock.

use std::sync::{Arc, OnceLock};

use elbowroom_model::Task;
use elbowroom_probability::Likelihoods;
use elbowroom_probability::optimum::Table;

use super::adaptable::Adaptable;
use super::{Goals, Registered};
use crate::executor::Need;

pub(super) const REGISTERED: Registered = Registered {
    name: "lookahead",
    argument: None,
    is_optional: false,
    summary: "Chooses each start so that success is most likely, counting retries and \
              detours, whether or not the action is in the plan. This needs a small world \
              without numbers and timed initials, in which nothing has to be done before \
              something else ends. In other worlds it acts like `adaptable`, but chooses the \
              most likely order again before each start if the plan is short.",
    paper: "goes beyond Ribeiro et al. (2021)",
    need: Need::PartialOrder,
    goals: Goals::Fixed,
    make: |_, means| {
        Box::new(Adaptable::with_foresight(
            means.likelihoods,
            means.foresight,
        ))
    },
};

/// The policy table of `lookahead` for a problem and its likelihoods, shared by clones. Nobody has
/// to fill it, and it changes no decision: it saves making the same table in every run.
#[derive(Clone, Debug, Default)]
pub struct Foresight(Arc<OnceLock<Option<Arc<Table>>>>);

impl Foresight {
    /// The table, made when it is first asked for; `None` if the world cannot be tabulated.
    pub(super) fn table(&self, task: &Task, likelihoods: &Likelihoods) -> Option<Arc<Table>> {
        let made = self
            .0
            .get_or_init(|| Table::new(task, likelihoods).map(Arc::new));
        made.clone()
    }
}
