//! Executor with the optimal policy of the world: [`LookaheadPolicy`].

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::Action;
use elbowroom_model::{State, Task, TimeTriggeredPlan};
use elbowroom_plan::{InstanceId, PartialOrderPlan};
use elbowroom_probability::likelihoods::Missing;
use elbowroom_probability::optimum::{Move, Optimum, Perturbed, Settings, TabulationError};
use elbowroom_probability::{Likelihoods, Model, Semantics};

use super::adaptable::{circumstances, execute_happening};
use super::{ActionName, ExecutorEntry, InstrumentedWorld, UntimedExecutor};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "lookahead",
    summary: "The optimal policy in the sound world (`docs/research/probability.md`), \
              regardless of the plan. It is exact if at most `most_running` actions \
              run at once.",
    paper: "goes beyond Ribeiro et al. (2021)",
    construct: |means| Ok(Box::new((means.foresight)()?)),
};

/// Optimal policy in the world of the likelihoods, independent of the plan: `lookahead` without a
/// clock.
#[derive(Clone, Debug)]
pub struct LookaheadPolicy {
    process: Perturbed,
    optimum: Optimum,
    instances: BTreeMap<ActionName, InstanceId>,
}

/// The world cannot be tabulated.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotTabulated {
    /// Likelihoods are missing.
    #[error(transparent)]
    Missing(#[from] Missing),
    /// The world is too large, or of an unsupported kind.
    #[error(transparent)]
    NotSmall(#[from] TabulationError),
}

impl LookaheadPolicy {
    /// Tabulates the world.
    ///
    /// # Errors
    /// Likelihoods are missing, or the world is too large.
    pub fn new(
        task: &Arc<Task>,
        actions: Vec<Action>,
        likelihoods: &Likelihoods,
        settings: Settings,
    ) -> Result<Self, NotTabulated> {
        let plan = PartialOrderPlan::unordered(task, actions);
        let model = Model::new(Arc::clone(task), plan, likelihoods, Semantics::World)?;
        let process = Perturbed::new(model, settings)?;
        let optimum = process.optimum();
        let instances = process.model().plan().instances();
        let instances = instances.map(|(id, instance)| {
            let action = &instance.action;
            ((action.schema, action.arguments.clone()), id)
        });
        Ok(Self {
            instances: instances.collect(),
            process,
            optimum,
        })
    }

    /// Returns `true` if a planner finds no plan from here. A state that is not in the table does
    /// not count as a dead end. See [`TrialSetup::dead_ends`](super::TrialSetup::dead_ends).
    pub fn is_dead_end(&self, state: &State, running: &[ActionName]) -> bool {
        let find = |name: &ActionName| self.instances.get(name).copied();
        let running: Option<Vec<InstanceId>> = running.iter().map(find).collect();
        running.is_some_and(|running| self.process.is_dead_end_at(state, &running))
    }

    /// Returns the maximum success probability of all executors from the beginning.
    pub fn value(&self) -> f64 {
        let initial = self.process.model().task().initial();
        self.optimum
            .value(&self.process, &circumstances(initial, &[]))
    }
}

impl UntimedExecutor for LookaheadPolicy {
    fn execute(&mut self, _: &Arc<TimeTriggeredPlan>, stage: &mut InstrumentedWorld<'_>) {
        let model = Arc::clone(self.process.model());
        let mut running: Vec<InstanceId> = Vec::new();
        while !(stage.is_over() || running.is_empty() && stage.is_goal()) {
            // Without detection of dead ends, it does not wait for spontaneous changes, because
            // that could take forever.
            if stage.is_dead_end().is_none() && self.process.is_dead_end_at(stage.state(), &running)
            {
                return;
            }
            let patience = stage.dead_end_steps_left();
            let chosen = self
                .optimum
                .choose_at(&self.process, stage.state(), &running, patience);
            match chosen {
                Move::Try(node) => {
                    if !execute_happening(&model, node, &mut running, stage) {
                        return;
                    }
                }
                Move::Abandon(id) => {
                    running.retain(|&other| other != id);
                    stage.abandon(&model.plan().instance(id).action);
                }
                Move::Stop => return,
            }
        }
    }
}
