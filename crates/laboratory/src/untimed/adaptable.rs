//! Olisipo as in the paper: [`Adaptable`].

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use elbowroom_model::ground::FactId;
use elbowroom_model::{Situation, State, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::partial_order::partial_order;
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_probability::dispatch::{goal_holds, lattermost_layer, never_interrupt};
use elbowroom_probability::{
    Candidates, Likelihoods, Model, OrderSearch, Running, SearchSettings, SearchState, Semantics,
    TotalOrderPlan,
};

use super::{ExecutorEntry, InstrumentedWorld, UntimedExecutor, start_of};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "adaptable",
    summary: "The paper's PGen and PExec. Running actions are ended before a plan is \
              abandoned. In a dead end, where there is no other plan, it takes the \
              most promising actions of its plan and relies on spontaneous changes.",
    paper: "Olisipo in Ribeiro et al. (2021), sections 2.2.1 and 2.2.2",
    construct: |means| {
        let (task, likelihoods) = means.task_and_likelihoods();
        Ok(Box::new(Adaptable::new(
            task,
            likelihoods,
            Semantics::Paper,
        )))
    },
};

/// Olisipo's executor. After every step, it continues with the happening after the lattermost layer
/// that fits. If no layer fits, it searches for the order most likely to succeed from the current
/// state. If there is none, it abandons the plan (paper 2, Algorithm 1 and section 2.2.1).
///
/// It never abandons a plan if there is no other one: in a dead end, it also accepts orders that
/// succeed only after spontaneous changes ([`Candidates::All`]). The paper does not specify this
/// case. Its P(A ∩ G) of such an order is not 0, and abandoning the plan is no better.
///
/// Choices are cached by order, state and running actions.
#[derive(Clone, Debug)]
pub struct Adaptable {
    task: Arc<Task>,
    likelihoods: Arc<Likelihoods>,
    semantics: Semantics,
    plans: Vec<(Arc<TimeTriggeredPlan>, Option<Prepared>)>,
}

/// Plan, with its search and the cached choices.
#[derive(Clone, Debug)]
struct Prepared {
    search: OrderSearch,
    /// Search for orders that rely on spontaneous changes.
    change_search: OrderSearch,
    /// All orders found so far.
    orders: Vec<TotalOrderPlan>,
    choices: BTreeMap<Key, Chosen>,
}

/// Current order, true facts and running actions.
type Key = (Option<usize>, BTreeSet<FactId>, Vec<InstanceId>);

#[derive(Clone, Copy, Debug)]
struct Chosen {
    /// The happening; `None` if the goal is reached or the plan is abandoned.
    next: Option<NodeId>,
    order: Option<usize>,
}

impl Adaptable {
    /// Creates an executor for plans of this task in a world of these likelihoods. `semantics`
    /// selects the valuation of orders: that of the paper, or that of the world.
    pub fn new(task: Arc<Task>, likelihoods: Arc<Likelihoods>, semantics: Semantics) -> Self {
        Self {
            task,
            likelihoods,
            semantics,
            plans: Vec::new(),
        }
    }

    fn prepare(&mut self, plan: &Arc<TimeTriggeredPlan>, state: &State) -> usize {
        let known = self.plans.iter().position(|(p, _)| Arc::ptr_eq(p, plan));
        known.unwrap_or_else(|| {
            let prepared =
                model(&self.task, plan, state, &self.likelihoods, self.semantics).map(|model| {
                    let model = Arc::new(model);
                    let lucky = SearchSettings {
                        candidates: Candidates::All,
                        ..SearchSettings::default()
                    };
                    Prepared {
                        search: OrderSearch::new(Arc::clone(&model), SearchSettings::default()),
                        change_search: OrderSearch::new(model, lucky),
                        orders: Vec::new(),
                        choices: BTreeMap::new(),
                    }
                });
            self.plans.push((Arc::clone(plan), prepared));
            self.plans.len() - 1
        })
    }
}

/// Returns the model of a plan's happenings, or `None` if the likelihoods do not cover one of its
/// actions.
pub(super) fn model(
    task: &Task,
    plan: &TimeTriggeredPlan,
    state: &State,
    likelihoods: &Likelihoods,
    semantics: Semantics,
) -> Option<Model> {
    let mut situation = Situation::initial(task);
    situation.state = state.clone();
    let task = task.starting_from(&situation);
    let plan = partial_order(&task, plan);
    Model::new(task, plan, likelihoods, semantics).ok()
}

/// Returns the believed state with the running actions.
pub(super) fn circumstances(state: &State, running: &[InstanceId]) -> SearchState {
    let mut circumstances = SearchState::observed(Rational::ZERO, state);
    let under_way = running.iter().map(|&instance| Running {
        instance,
        start: Rational::ZERO,
    });
    circumstances.running = under_way.collect();
    circumstances
}

/// Executes a happening of a plan, and updates the running actions. Returns `false` if its
/// condition does not hold.
pub(super) fn execute_happening(
    model: &Model,
    node: NodeId,
    running: &mut Vec<InstanceId>,
    stage: &mut InstrumentedWorld<'_>,
) -> bool {
    match model.plan().nodes[node.index()] {
        Node::Start(id) | Node::Instant(id) => {
            let action = &model.plan().instance(id).action;
            if !stage.holds(&start_of(action).condition) {
                return false;
            }
            if stage.attempt(action) && action.durative().is_some() {
                running.push(id);
            }
        }
        Node::End(id) => {
            let action = &model.plan().instance(id).action;
            let holds =
                |body: &elbowroom_model::ground::DurativeBody| stage.holds(&body.end.condition);
            if !action.durative().is_some_and(holds) {
                return false;
            }
            running.retain(|&other| other != id);
            stage.end(action);
        }
        Node::Zero | Node::Timed(_) => return false,
    }
    true
}

impl Prepared {
    fn choose(
        &mut self,
        order: Option<usize>,
        stage: &InstrumentedWorld<'_>,
        running: &[InstanceId],
    ) -> Chosen {
        let key = (order, stage.state().facts.clone(), running.to_vec());
        if let Some(known) = self.choices.get(&key) {
            return *known;
        }
        let is_dead_end = stage.is_dead_end() == Some(true);
        let now = circumstances(stage.state(), running);
        let chosen = self.compute_choice(order, &now, is_dead_end);
        self.choices.insert(key, chosen);
        chosen
    }

    fn compute_choice(
        &mut self,
        order: Option<usize>,
        now: &SearchState,
        is_dead_end: bool,
    ) -> Chosen {
        let stop = Chosen { next: None, order };
        if now.running.is_empty() && goal_holds(self.search.model(), now) {
            return stop;
        }
        if let Some(index) = order
            && let Some((at, _)) = lattermost_layer(&self.search, &self.orders[index], now)
        {
            let next = Some(self.orders[index].sequence[at]);
            return Chosen { next, order };
        }
        // A condition that couples too many facts counts as if there were no order.
        let found = self.search.best_order(now, &mut never_interrupt).ok();
        let Some(found) = found.and_then(|found| found.order) else {
            if is_dead_end && let Some(next) = self.next_by_spontaneous_change(now) {
                return Chosen {
                    next: Some(next),
                    order: None,
                };
            }
            // The plan does not reach the goal from here. Running actions end before it is
            // abandoned, because a robot whose motion is abandoned would be at neither of two
            // places.
            let model = self.search.model();
            let first = now.running.first();
            let end = first.and_then(|first| {
                model
                    .plan()
                    .nodes
                    .iter()
                    .position(|node| *node == Node::End(first.instance))
            });
            return Chosen {
                next: end.map(NodeId::from),
                order,
            };
        };
        let next = found.sequence.first().copied();
        let known = self.orders.iter().position(|order| *order == found);
        let index = known.unwrap_or(self.orders.len());
        if known.is_none() {
            self.orders.push(found);
        }
        Chosen {
            next,
            order: Some(index),
        }
    }

    /// Returns the first happening of the order most likely to succeed with the help of spontaneous
    /// changes.
    fn next_by_spontaneous_change(&mut self, now: &SearchState) -> Option<NodeId> {
        let found = self
            .change_search
            .best_order(now, &mut never_interrupt)
            .ok()?;
        found.order?.sequence.first().copied()
    }
}

impl UntimedExecutor for Adaptable {
    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut InstrumentedWorld<'_>) {
        let index = self.prepare(plan, stage.state());
        let Some(prepared) = &mut self.plans[index].1 else {
            return;
        };
        let model = Arc::clone(prepared.search.model());
        let (mut order, mut running) = (None, Vec::new());
        while !stage.is_over() {
            let chosen = prepared.choose(order, stage, &running);
            order = chosen.order;
            let is_done = |node| execute_happening(&model, node, &mut running, stage);
            if !chosen.next.is_some_and(is_done) {
                return;
            }
        }
    }
}
