//! The planner that is built in, for worlds without time: [`EmbeddedPlans`].

use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_execution::{PlanAnswer, Planner as _};
use elbowroom_model::ground::FactId;
use elbowroom_model::{Situation, State, Task, TimeTriggeredPlan};
use elbowroom_planner::embedded;

use crate::execute::Embedded;

/// Plans by the state they begin in, made once each.
pub(super) struct EmbeddedPlans {
    task: Arc<Task>,
    known: BTreeMap<BTreeSet<FactId>, Option<Arc<TimeTriggeredPlan>>>,
}

/// More states than this are not looked at; then it counts as if there were no plan.
const MOST_STATES: u64 = 100_000;

impl EmbeddedPlans {
    pub(super) fn new(task: Arc<Task>) -> Self {
        Self {
            task,
            known: BTreeMap::new(),
        }
    }

    /// The plan from here, if one is found.
    pub(super) fn plan(&mut self, state: &State) -> Option<Arc<TimeTriggeredPlan>> {
        if let Some(known) = self.known.get(&state.facts) {
            return known.clone();
        }
        let mut planner = Embedded {
            settings: embedded::Settings::default(),
            most_states: MOST_STATES,
            improve_states: 0,
            clock: None,
        };
        let mut task = (*self.task).clone();
        let situation = Situation {
            state: state.clone(),
            ..Situation::initial(&task)
        };
        let plan = match planner.plan(&mut task, &situation).answer {
            PlanAnswer::Plan(plan) => Some(Arc::new(plan)),
            PlanAnswer::Unsolvable | PlanAnswer::NotFound { .. } => None,
        };
        self.known.insert(state.facts.clone(), plan.clone());
        plan
    }
}
