//! `lookahead`: the best action in the world of the likelihoods, on a clock.

use std::sync::{Arc, Mutex, PoisonError};

use elbowroom_model::Task;
use elbowroom_model::ground::Condition;
use elbowroom_probability::Likelihoods;
use elbowroom_probability::optimum::PolicyTable;

use super::adaptable::Adaptable;
use super::{ExecutorEntry, Needs};
use crate::executor::PlanForm;

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "lookahead",
    argument: None,
    is_optional: false,
    summary: "Chooses each start so that success is most likely, including retries and detours, \
              whether or not the action is in the plan. This needs a small world without numbers \
              and timed initials, in which no action has to end while another one is running. In \
              other worlds it acts like `adaptable`, but chooses the most likely order again \
              before each start if the plan is short.",
    paper: "goes beyond Ribeiro et al. (2021)",
    needs: Needs {
        orders: true,
        ..Needs::plan(PlanForm::PartialOrder)
    },
    roles: &[],
    make: |_, means| {
        Box::new(Adaptable::with_policy_tables(
            means.likelihoods,
            means.policy_cache,
        ))
    },
};

/// Cache of `lookahead`'s policy table for a problem and its likelihoods, shared by clones. It does
/// not change decisions; it avoids computing the same table in every run. When the goal changes,
/// the table is replaced.
#[derive(Clone, Debug, Default)]
pub struct PolicyTableCache(Arc<Mutex<Option<GoalTable>>>);

/// The table for a goal; `None` if the world cannot be tabulated.
#[derive(Debug)]
struct GoalTable {
    goal: Condition,
    table: Option<Arc<PolicyTable>>,
}

impl PolicyTableCache {
    /// Returns the table for the goal of the task; `None` if the world cannot be tabulated.
    pub(super) fn table(&self, task: &Task, likelihoods: &Likelihoods) -> Option<Arc<PolicyTable>> {
        let mut known = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = known.as_ref().filter(|it| it.goal == *task.goal()) {
            return known.table.clone();
        }
        let table = PolicyTable::new(task, likelihoods).map(Arc::new);
        *known = Some(GoalTable {
            goal: task.goal().clone(),
            table: table.clone(),
        });
        table
    }
}
