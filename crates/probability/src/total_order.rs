//! An order of a plan's happenings, with what must hold between them: [`TotalOrderPlan`].

mod regress;

use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use crate::circumstances::Circumstances;
use crate::model::{Model, evaluate};
use crate::network::{Happenings, PrunedNetwork};

/// Happenings in a row, and the layers of the pruned network between them.
#[doc(alias = "Γ")]
#[derive(Clone, Debug, PartialEq)]
pub struct TotalOrderPlan {
    /// The happenings: nodes of the partially ordered plan.
    pub sequence: Vec<NodeId>,
    /// Of each happening, whether it comes at the same moment as the one before it, because they need each other.
    pub joined: Vec<bool>,
    /// One more than happenings: layer `i` is what must hold before `sequence[i]` for the rest to
    /// work if nothing more goes wrong; the last is the goal.
    pub layers: Vec<Layer>,
    /// The window of each happening, if the order begins when it was found.
    pub slots: Vec<Slot>,
    /// P(A): that all happenings succeed.
    pub actions_probability: f64,
    /// P(A ∩ G): that all happenings succeed and the goal holds after them.
    pub probability: f64,
    /// The number of numeric conditions that were taken for granted, because the numbers they read
    /// depend on when things happen and not only on their order.
    pub assumed_conditions: usize,
}

/// The conditions that must hold between two happenings.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Layer {
    /// Facts with the truth they must have, sorted.
    pub literals: Vec<(FactId, bool)>,
    /// Conditions on numbers, or on several facts at once.
    pub conditions: Vec<Condition>,
    /// The actions under way there, sorted.
    pub running: Vec<InstanceId>,
}

/// The time window of a happening.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// Which one.
    pub node: NodeId,
    /// The earliest time.
    pub earliest: Rational,
    /// The latest time; `None` if there is no upper bound.
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
    /// The order that a network has, begun in these circumstances.
    pub(crate) fn new(
        model: &Model,
        circumstances: &Circumstances,
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

    /// The happenings that come at the same moment as the one at `position`, and before it. Empty unless they need each
    /// other.
    pub(crate) fn joined_before(&self, position: usize) -> &[NodeId] {
        let joined = self.joined[..=position].iter().rev();
        let count = joined.take_while(|is_joined| **is_joined).count();
        &self.sequence[position - count..position]
    }

    /// The same order, begun so much later.
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
    /// Whether what is believed fits: whether each fact is more likely to be as required than not,
    /// all conditions hold of what is more likely, and the same actions are under way.
    pub fn fits(&self, model: &Model, circumstances: &Circumstances) -> bool {
        let mut running: Vec<InstanceId> =
            circumstances.running.iter().map(|r| r.instance).collect();
        running.sort_unstable();
        running == self.running && self.holds(model, circumstances)
    }

    /// The same, whatever is under way.
    pub fn holds(&self, model: &Model, circumstances: &Circumstances) -> bool {
        let is_likely = |fact: FactId| circumstances.belief.probability(fact) >= 0.5;
        self.literals
            .iter()
            .all(|&(fact, truth)| is_likely(fact) == truth)
            && self.conditions_hold(model, circumstances)
    }

    /// Whether the conditions on numbers and on several facts hold.
    pub(crate) fn conditions_hold(&self, model: &Model, circumstances: &Circumstances) -> bool {
        let is_likely = |fact: FactId| circumstances.belief.probability(fact) >= 0.5;
        let value = |leaf: &Expression| circumstances.value(leaf);
        let task = model.task();
        self.conditions.iter().all(|condition| {
            // A duration that is not known cannot speak against it.
            evaluate(task, condition, &is_likely, &value).unwrap_or(true)
        })
    }
}
