//! Embedded planner for worlds without time: [`EmbeddedPlans`].

use std::collections::BTreeMap;
use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_execution::{PlanAnswer, Planner as _};
use elbowroom_model::ground::FactId;
use elbowroom_model::{Situation, State, Task, TimeTriggeredPlan};
use elbowroom_planner::embedded;

use elbowroom::execute::Embedded;

/// Cache of plans by their initial state.
pub(super) struct EmbeddedPlans {
    task: Arc<Task>,
    plans: BTreeMap<BTreeSet<FactId>, Option<Arc<TimeTriggeredPlan>>>,
}

/// Maximum number of states in a search. A larger search counts as finding no plan.
const MAX_STATES: u64 = 100_000;

impl EmbeddedPlans {
    pub(super) fn new(task: Arc<Task>) -> Self {
        Self {
            task,
            plans: BTreeMap::new(),
        }
    }

    /// Returns the plan from a state, if one is found.
    pub(super) fn plan(&mut self, state: &State) -> Option<Arc<TimeTriggeredPlan>> {
        if let Some(known) = self.plans.get(&state.facts) {
            return known.clone();
        }
        let mut planner = Embedded {
            settings: embedded::Settings::default(),
            most_states: MAX_STATES,
            improve_states: 0,
            // A proof that no plan exists makes no difference to a trial.
            certificate_work: 0,
            ..Embedded::default()
        };
        // Rows run in parallel. With its own table, each is independent of facts that the others
        // add.
        let task = self.task.with_own_table();
        let situation = Situation {
            state: state.clone(),
            ..Situation::initial(&task)
        };
        let plan = match planner.plan(&task, &situation).answer {
            PlanAnswer::Plan(plan) => Some(Arc::new(plan)),
            _ => None,
        };
        self.plans.insert(state.facts.clone(), plan.clone());
        plan
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;
    use std::sync::Arc;

    use crate::untimed::{Shortest, all_actions};
    use elbowroom_model::ground::FactId;
    use elbowroom_model::validate::{Settings, validate_from};
    use elbowroom_model::{Situation, State, Task};
    use elbowroom_pddl::{Source, read_problem};

    use super::EmbeddedPlans;

    /// Reads a task of the experiments.
    fn task(name: &str) -> Task {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../experiments/olisipo");
        let source = |what: &str| {
            let name = format!("{name}-{what}.pddl");
            Source::new(&name, fs::read_to_string(folder.join(&name)).unwrap())
        };
        let (problem, _) = read_problem(&source("domain"), &source("problem")).unwrap();
        Task::new(problem)
    }

    /// Generates pseudorandom states by a linear congruential generator.
    fn states(task: &Task, count: usize) -> Vec<State> {
        let facts: Vec<FactId> = (0..).map(FactId).take(task.fact_count()).collect();
        let mut bits = 1_u64;
        let mut next = || {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            bits >> 63 == 1
        };
        let mut state = || State {
            facts: facts.iter().copied().filter(|_| next()).collect(),
            ..task.initial().clone()
        };
        (0..count).map(|_| state()).collect()
    }

    #[test]
    fn embedded_planner_is_complete() {
        for name in ["sf3", "af3"] {
            let task = task(name);
            let actions = all_actions(&task).unwrap();
            let task = Arc::new(task);
            let mut embedded = EmbeddedPlans::new(Arc::clone(&task));
            let mut shortest = Shortest::new(Arc::clone(&task), actions);
            let mut counts = [0, 0];
            for state in states(&task, 300) {
                let plan = embedded.plan(&state);
                let known = shortest.plan(&state);
                assert_eq!(plan.is_some(), known.is_some(), "{name}: {state:?}");
                counts[usize::from(plan.is_some())] += 1;
                let Some(plan) = plan else { continue };
                // The same state gives the same plan, because executors cache results by plan.
                assert!(Arc::ptr_eq(&plan, &embedded.plan(&state).unwrap()));
                let situation = Situation {
                    state,
                    ..Situation::initial(&task)
                };
                let verdict = validate_from(&task, &situation, &plan, &Settings::default());
                assert!(verdict.is_valid(), "{name}: {verdict:?}");
                assert!(plan.steps.len() >= known.unwrap().steps.len());
            }
            assert!(counts.iter().all(|count| *count > 20), "{name}: {counts:?}");
        }
    }
}
