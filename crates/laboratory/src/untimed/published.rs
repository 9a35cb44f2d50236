//! Olisipo in the version that made the paper's table: [`PublishedExecutor`].

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::FactId;
use elbowroom_model::{State, Task, TimeTriggeredPlan};
use elbowroom_plan::{InstanceId, Node, NodeId};
use elbowroom_probability::{
    Likelihoods, Model, OrderSearch, PrunedNetwork, SearchSettings, Semantics, TotalOrderPlan,
};

use super::adaptable::{circumstances, execute_happening, model};
use super::{ExecutorEntry, InstrumentedWorld, UntimedExecutor, apply, holds, start_of};

pub(super) const REGISTERED: ExecutorEntry = ExecutorEntry {
    name: "as-published",
    summary: "The authors' program: the last order found instead of the best, and no second \
              search. When its order no longer fits, it stops (the authors' program executed a \
              few more actions, without effect).",
    paper: "the program behind the results of Ribeiro et al. (2021)",
    construct: |means| {
        let (task, likelihoods) = means.task_and_likelihoods();
        Ok(Box::new(PublishedExecutor::new(task, likelihoods)))
    },
};

/// The published program, with the faults on which its results depend:
///
/// - the search returns the *last* order found, not the best;
/// - the belief is never updated, so that no later search finds an order: there is one order in
///   each trial;
/// - if a layer fits and an action is running, the next step is the end of that action, whatever
///   the layer; so actions are executed one after the other. If no action is running, only layers
///   before a start are considered.
///
/// There is one difference. When no layer fitted any more, the program continued in the remaining
/// rounds with the old order applied to the happenings of new plans. This never reached the goal,
/// and is omitted here.
#[derive(Clone, Debug)]
pub struct PublishedExecutor {
    task: Arc<Task>,
    likelihoods: Arc<Likelihoods>,
    orders: Vec<(Arc<TimeTriggeredPlan>, Option<FoundOrder>)>,
    /// `true` if this trial's order was abandoned.
    is_abandoned: bool,
}

#[derive(Clone, Debug)]
struct FoundOrder {
    model: Arc<Model>,
    sequence: Vec<NodeId>,
    /// Facts that must be true. Negative conditions were treated as positive ones.
    layers: Vec<BTreeSet<FactId>>,
}

impl PublishedExecutor {
    /// Creates an executor for plans of this task in a world of these likelihoods.
    pub fn new(task: Arc<Task>, likelihoods: Arc<Likelihoods>) -> Self {
        Self {
            task,
            likelihoods,
            orders: Vec::new(),
            is_abandoned: false,
        }
    }

    fn order(&mut self, plan: &Arc<TimeTriggeredPlan>, state: &State) -> usize {
        let known = self.orders.iter().position(|(p, _)| Arc::ptr_eq(p, plan));
        known.unwrap_or_else(|| {
            let model = model(&self.task, plan, state, &self.likelihoods, Semantics::Paper);
            let found = model.and_then(|model| last_order(Arc::new(model), state));
            self.orders.push((Arc::clone(plan), found));
            self.orders.len() - 1
        })
    }
}

impl UntimedExecutor for PublishedExecutor {
    fn begin(&mut self) {
        self.is_abandoned = false;
    }

    fn execute(&mut self, plan: &Arc<TimeTriggeredPlan>, stage: &mut InstrumentedWorld<'_>) {
        if self.is_abandoned {
            return;
        }
        self.is_abandoned = true;
        let index = self.order(plan, stage.state());
        let Some(found) = &self.orders[index].1 else {
            return;
        };
        let mut running = Vec::new();
        while !(stage.is_over() || running.is_empty() && stage.is_goal()) {
            let Some(next) = found.next(stage.state(), &running) else {
                return;
            };
            if !execute_happening(&found.model, next, &mut running, stage) {
                return;
            }
        }
    }
}

impl FoundOrder {
    fn next(&self, state: &State, running: &[InstanceId]) -> Option<NodeId> {
        let nodes = &self.model.plan().nodes;
        let fits = |layer: &BTreeSet<FactId>| layer.is_subset(&state.facts);
        let mut fitting = (0..self.layers.len())
            .rev()
            .filter(|&i| fits(&self.layers[i]));
        if let Some(first) = running.first() {
            fitting.next()?;
            let end = nodes.iter().position(|node| *node == Node::End(*first));
            return end.map(NodeId::from);
        }
        let is_start =
            |node: &NodeId| matches!(nodes[node.index()], Node::Start(_) | Node::Instant(_));
        fitting.find_map(|i| self.sequence.get(i).copied().filter(is_start))
    }
}

/// Returns the last order that the published search finds.
fn last_order(model: Arc<Model>, state: &State) -> Option<FoundOrder> {
    let mut search = LastOrder {
        orders: OrderSearch::new(Arc::clone(&model), SearchSettings::default()),
        network: PrunedNetwork::new(&model, &circumstances(state, &[])).ok()?,
        initial: state,
        last: None,
        last_probability: 0.0,
    };
    search.explore(state);
    let sequence = search.last.take()?;
    let layers = layers(&model, state, &sequence)?;
    let positive = |order: TotalOrderPlan| {
        let facts = |layer: &elbowroom_probability::Layer| {
            layer.literals.iter().map(|(fact, _)| *fact).collect()
        };
        order.layers.iter().map(facts).collect()
    };
    Some(FoundOrder {
        layers: positive(layers),
        model,
        sequence,
    })
}

fn layers(model: &Arc<Model>, state: &State, sequence: &[NodeId]) -> Option<TotalOrderPlan> {
    OrderSearch::new(Arc::clone(model), SearchSettings::default())
        .order_of(&circumstances(state, &[]), sequence)
        .ok()
}

/// Depth-first search with happenings in the order of the plan, and with the published cut only.
struct LastOrder<'m> {
    orders: OrderSearch,
    network: PrunedNetwork<'m>,
    initial: &'m State,
    last: Option<Vec<NodeId>>,
    last_probability: f64,
}

impl LastOrder<'_> {
    fn explore(&mut self, state: &State) {
        let sequence = self.network.sequence().to_vec();
        let now = circumstances(self.initial, &[]);
        if self.orders.windows(&now, &sequence).is_none() {
            return;
        }
        let model = Arc::clone(self.orders.model());
        if holds(model.task().goal(), state) {
            self.last_probability = self.network.success_probability().unwrap_or(0.0);
            self.last = Some(sequence);
            return;
        }
        for (index, node) in model.plan().nodes.iter().enumerate() {
            let id = NodeId::from(index);
            if sequence.contains(&id) {
                continue;
            }
            let mut after = state.clone();
            let can_be = match *node {
                Node::Start(instance) | Node::Instant(instance) => {
                    let action = &model.plan().instance(instance).action;
                    apply(start_of(action), &mut after);
                    let over_all = action.durative().map(|body| &body.over_all);
                    holds(&start_of(action).condition, state)
                        && over_all.is_none_or(|condition| holds(condition, state))
                }
                Node::End(instance) => {
                    let action = &model.plan().instance(instance).action;
                    let has_started = sequence
                        .iter()
                        .any(|node| model.plan().nodes[node.index()] == Node::Start(instance));
                    has_started
                        && action.durative().is_some_and(|body| {
                            apply(&body.end, &mut after);
                            holds(&body.end.condition, state)
                        })
                }
                Node::Zero | Node::Timed(_) => false,
            };
            if !can_be {
                continue;
            }
            if let Ok(probability) = self.network.push(id) {
                if probability > self.last_probability {
                    self.explore(&after);
                }
                self.network.pop();
            }
        }
    }
}
