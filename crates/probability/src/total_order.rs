//! An order of a plan's happenings, with the conditions between them: [`TotalOrderPlan`].

mod regress;

use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::model::{Model, evaluate};
use crate::network::{Happenings, PrunedNetwork};
use crate::search_state::SearchState;

/// A sequence of happenings, and the layers of the pruned network between them.
#[doc(alias = "Γ")]
#[derive(Clone, Debug, PartialEq)]
pub struct TotalOrderPlan {
    /// Happenings, as nodes of the partially ordered plan.
    pub sequence: Vec<NodeId>,
    /// For each happening, `true` if it comes at the same moment as the previous one, because they
    /// need each other.
    pub joined: Vec<bool>,
    /// Layers, one more than happenings. Layer `i` contains the conditions before `sequence[i]`
    /// under which the remaining happenings work without failures. The last layer is the goal.
    pub layers: Vec<Layer>,
    /// Time window of each happening, if the order begins at the time of the search.
    pub slots: Vec<Slot>,
    /// P(A): probability that all happenings succeed.
    pub actions_probability: f64,
    /// P(A ∩ G): probability that all happenings succeed and the goal holds after them.
    pub probability: f64,
    /// Number of numeric conditions that are assumed to hold, because their numbers depend on the
    /// times of happenings, not only on their order.
    pub assumed_conditions: usize,
}

/// Conditions between two happenings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layer {
    /// Facts with the required truth values, sorted.
    pub literals: Vec<(FactId, bool)>,
    /// Conditions on numbers, or on several facts at once.
    pub conditions: Vec<Condition>,
    /// Running actions, sorted.
    pub running: Vec<InstanceId>,
}

/// Time window of a happening.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The happening.
    pub node: NodeId,
    /// Earliest time.
    pub earliest: Rational,
    /// Latest time; `None` if it is unbounded.
    pub latest: Option<Rational>,
}

impl<'a> From<&'a TotalOrderPlan> for Happenings<'a> {
    fn from(order: &'a TotalOrderPlan) -> Self {
        Self {
            sequence: &order.sequence,
            joined: &order.joined,
        }
    }
}

impl TotalOrderPlan {
    /// Returns the order of a network that begins in these circumstances.
    pub(crate) fn new(
        model: &Model,
        circumstances: &SearchState,
        network: &PrunedNetwork<'_>,
        probability: f64,
        slots: Vec<Slot>,
    ) -> Self {
        let sequence = network.sequence().to_vec();
        let running = circumstances.running.iter();
        let mut running: Vec<InstanceId> = running.map(|running| running.instance).collect();
        let mut under_way = vec![sorted(&running)];
        for &node in &sequence {
            step(model, &mut running, node);
            under_way.push(sorted(&running));
        }
        let joined = network.joined();
        Self {
            layers: regress::layers(model, (&sequence, &joined), under_way),
            sequence,
            joined,
            slots,
            actions_probability: network.actions_probability(),
            probability,
            assumed_conditions: network.assumed_conditions(),
        }
    }

    /// Returns `true` if happenings of this order come at the same moment because they need each other.
    pub fn has_joined(&self) -> bool {
        self.joined.contains(&true)
    }

    /// Returns the happenings before the one at `position` that come at the same moment. Empty
    /// unless they need each other.
    pub(crate) fn joined_before(&self, position: usize) -> &[NodeId] {
        let joined = self.joined[..=position].iter().rev();
        let count = joined.take_while(|is_joined| **is_joined).count();
        &self.sequence[position - count..position]
    }

    /// Returns the order, begun `delay` later.
    #[must_use]
    pub(crate) fn delayed(&self, delay: &Rational) -> Self {
        let mut order = self.clone();
        if !delay.is_zero() {
            for slot in &mut order.slots {
                slot.earliest = &slot.earliest + delay;
                slot.latest = slot.latest.as_ref().map(|latest| latest + delay);
            }
        }
        order
    }
}

fn sorted(running: &[InstanceId]) -> Vec<InstanceId> {
    let mut running = running.to_vec();
    running.sort_unstable();
    running
}

fn step(model: &Model, running: &mut Vec<InstanceId>, node: NodeId) {
    match model.plan().nodes[node.index()] {
        Node::Start(id) => running.push(id),
        Node::End(id) => running.retain(|other| *other != id),
        Node::Zero | Node::Instant(_) | Node::Timed(_) => {}
    }
}

impl Layer {
    /// Returns `true` if the layer fits the circumstances: each fact is more likely to have the
    /// required value than not, all conditions hold in the most likely state, and the running
    /// actions are the same.
    pub fn fits(&self, model: &Model, circumstances: &SearchState) -> bool {
        let mut running: Vec<InstanceId> =
            circumstances.running.iter().map(|r| r.instance).collect();
        running.sort_unstable();
        running == self.running && self.holds(model, circumstances)
    }

    /// Like [`Self::fits`], for any running actions.
    pub fn holds(&self, model: &Model, circumstances: &SearchState) -> bool {
        let is_likely = |fact: FactId| circumstances.belief.probability(fact) >= 0.5;
        self.literals
            .iter()
            .all(|&(fact, truth)| is_likely(fact) == truth)
            && self.conditions_hold(model, circumstances)
    }

    /// Returns `true` if the conditions on numbers and on several facts hold.
    pub(crate) fn conditions_hold(&self, model: &Model, circumstances: &SearchState) -> bool {
        let is_likely = |fact: FactId| circumstances.belief.probability(fact) >= 0.5;
        let value = |leaf: &Expression| circumstances.value(leaf);
        let task = model.task();
        self.conditions.iter().all(|condition| {
            // A condition that depends on an unknown duration counts as true.
            evaluate(task, condition, &is_likely, &value).unwrap_or(true)
        })
    }
}
