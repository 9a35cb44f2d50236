//! STN plans: time points and bounds on their differences.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

use crate::valuation::{ParameterId, Valuation};

/// A time point of an [`StnPlan`], by position in [`StnPlan::nodes`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct NodeId(pub u32);

impl NodeId {
    /// The start of the plan, time 0; always the first node.
    pub const ZERO: Self = Self(0);

    /// Returns the position in [`StnPlan::nodes`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl From<usize> for NodeId {
    fn from(index: usize) -> Self {
        Self(u32::try_from(index).expect("fewer than 2^32 time points"))
    }
}

/// An action instance of an [`StnPlan`], by position in [`StnPlan::instances`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct InstanceId(pub u32);

impl InstanceId {
    /// Returns the position in [`StnPlan::instances`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

impl From<usize> for InstanceId {
    fn from(index: usize) -> Self {
        Self(u32::try_from(index).expect("fewer than 2^32 action instances"))
    }
}

/// The event at a time point of a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Node {
    /// The plan begins; time 0.
    Zero,
    /// A durative action starts.
    Start(InstanceId),
    /// A durative action ends.
    End(InstanceId),
    /// An instantaneous action happens.
    Instant(InstanceId),
    /// The timed initials of one time happen: an index into [`Task::timed`].
    Timed(usize),
}

/// An action of the plan, with its label in constraints.
#[derive(Clone, Debug, PartialEq)]
pub struct Instance {
    /// `n0`, `refuel_2`, …; unique in its plan.
    pub label: String,
    /// The action. Open numbers are `Expression::Unknown(Unknown::Parameter(_))`.
    pub action: Arc<Action>,
}

/// One side of a [`Constraint`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Bound {
    /// No limit.
    Infinite,
    /// A number.
    Finite(Rational),
    /// The value of a parameter.
    Parameter(ParameterId),
}

impl Bound {
    /// Returns the parameter, if the bound is one.
    pub fn parameter(&self) -> Option<ParameterId> {
        match self {
            Self::Parameter(id) => Some(*id),
            Self::Infinite | Self::Finite(_) => None,
        }
    }

    /// Returns the limit for these values of the parameters; `None` if there is none.
    pub fn at(&self, valuation: &Valuation) -> Option<Rational> {
        match self {
            Self::Infinite => None,
            Self::Finite(value) => Some(value.clone()),
            Self::Parameter(id) => Some(valuation[*id].clone()),
        }
    }
}

impl From<Rational> for Bound {
    fn from(value: Rational) -> Self {
        Self::Finite(value)
    }
}

/// `lower <= to - from <= upper`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constraint {
    /// The time point subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// Least difference; [`Bound::Infinite`] means minus infinity.
    pub lower: Bound,
    /// Greatest difference.
    pub upper: Bound,
    /// Reason for the constraint.
    pub reason: Reason,
}

/// Reason for a constraint of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reason {
    /// It is from an STN plan file.
    Given,
    /// The duration of an action, from its domain.
    Duration(InstanceId),
    /// The fixed time of timed initials.
    Timed(usize),
    /// The two happenings interfere and keep their order.
    Interference,
    /// Two instances of one ground action do not overlap, and keep their order.
    SelfOverlap,
    /// One of the happenings writes a fact or fluent that an over-all condition of the other's
    /// action reads.
    OverAll,
    /// The same for a condition that compares numbers and a happening that increases or decreases
    /// one. Whether this constraint is needed depends on the numbers.
    Side,
    /// A trajectory constraint keeps the changes of its facts in their order, or bounds their
    /// times.
    TrajectoryConstraint,
    /// Fixed at, or near, the difference in the original plan, because of numeric conditions.
    Pinned,
}

/// A plan as a simple temporal network: nodes with meanings, and constraints between them.
///
/// In addition to the listed constraints, every node is at time 0 or later.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StnPlan {
    /// The actions.
    pub instances: Vec<Instance>,
    /// The time points; the first is [`Node::Zero`].
    pub nodes: Vec<Node>,
    /// Bounds on differences of time points.
    pub constraints: Vec<Constraint>,
}

/// Position of a node in the order of [`StnPlan::unconstrained`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Place {
    Zero,
    Instance(InstanceId),
    Timed(usize),
}

fn place_of(node: Node) -> Place {
    match node {
        Node::Zero => Place::Zero,
        Node::Start(id) | Node::End(id) | Node::Instant(id) => Place::Instance(id),
        Node::Timed(index) => Place::Timed(index),
    }
}

impl StnPlan {
    /// Returns the plan of these instances without any constraint except those that fix the timed
    /// initials.
    ///
    /// Nodes: zero, then each instance's start and end, or instant, in order, then the timed
    /// initials in order of time.
    pub fn unconstrained(task: &Task, instances: Vec<Instance>) -> Self {
        let mut nodes = vec![Node::Zero];
        for (index, instance) in instances.iter().enumerate() {
            let id = InstanceId::from(index);
            match instance.action.body {
                Body::Instantaneous(_) => nodes.push(Node::Instant(id)),
                Body::Durative(_) => nodes.extend([Node::Start(id), Node::End(id)]),
            }
        }
        let mut constraints = Vec::new();
        for (index, timed) in task.timed().iter().enumerate() {
            constraints.push(Constraint {
                from: NodeId::ZERO,
                to: NodeId::from(nodes.len()),
                lower: Bound::Finite(timed.time.clone()),
                upper: Bound::Finite(timed.time.clone()),
                reason: Reason::Timed(index),
            });
            nodes.push(Node::Timed(index));
        }
        Self {
            instances,
            nodes,
            constraints,
        }
    }

    /// Returns the instance with that id.
    pub fn instance(&self, id: InstanceId) -> &Instance {
        &self.instances[id.index()]
    }

    /// Removes the domain's duration constraints from the instance, because its duration is
    /// determined in another way.
    pub fn free_duration(&mut self, id: InstanceId) {
        let action = &mut self.instances[id.index()].action;
        if action
            .durative()
            .is_some_and(|body| !body.duration.is_empty())
            && let Body::Durative(body) = &mut Arc::make_mut(action).body
        {
            body.duration.clear();
        }
    }

    /// Like [`Self::free_duration`], for several instances. Instances that share an action still
    /// share one afterwards.
    pub(crate) fn free_durations(&mut self, ids: impl IntoIterator<Item = InstanceId>) {
        // The map keeps the original actions alive, so that their addresses are not reused.
        let mut freed: BTreeMap<*const Action, [Arc<Action>; 2]> = BTreeMap::new();
        for id in ids {
            let before = Arc::clone(&self.instances[id.index()].action);
            if let Some([_, after]) = freed.get(&Arc::as_ptr(&before)) {
                self.instances[id.index()].action = Arc::clone(after);
                continue;
            }
            self.free_duration(id);
            let after = Arc::clone(&self.instances[id.index()].action);
            freed.insert(Arc::as_ptr(&before), [before, after]);
        }
    }

    /// Returns the node at which the instance starts, or happens.
    pub fn start(&self, id: InstanceId) -> NodeId {
        let is_it = |node| matches!(node, Node::Start(i) | Node::Instant(i) if i == id);
        self.find_node(Place::Instance(id), is_it)
    }

    /// Returns the node at which the instance ends, or happens.
    pub fn end(&self, id: InstanceId) -> NodeId {
        let is_it = |node| matches!(node, Node::End(i) | Node::Instant(i) if i == id);
        self.find_node(Place::Instance(id), is_it)
    }

    /// Returns the instance whose duration a constraint bounds; `None` if it bounds another
    /// difference.
    pub fn duration_of(&self, constraint: &Constraint) -> Option<InstanceId> {
        let node = |id: NodeId| self.nodes[id.index()];
        match (node(constraint.from), node(constraint.to)) {
            (Node::Start(start), Node::End(end)) if start == end => Some(start),
            _ => None,
        }
    }

    /// Returns the node of a group of timed initials.
    pub fn timed(&self, index: usize) -> NodeId {
        self.find_node(Place::Timed(index), |node| node == Node::Timed(index))
    }

    /// Finds a node by binary search, if nodes are in the order of
    /// [`unconstrained`](Self::unconstrained), as they mostly are. The field is public, so other
    /// orders are possible; these need a linear search.
    fn find_node(&self, place: Place, is_it: impl Fn(Node) -> bool) -> NodeId {
        let first = self.nodes.partition_point(|&node| place_of(node) < place);
        let mut near = (first..self.nodes.len()).take(2);
        let near = near.find(|&index| is_it(self.nodes[index]));
        let index = near.or_else(|| self.nodes.iter().position(|&node| is_it(node)));
        NodeId::from(index.expect("every instance and timed initial has its nodes"))
    }

    /// Returns all nodes with their meaning.
    pub fn nodes(&self) -> impl Iterator<Item = (NodeId, Node)> + '_ {
        self.nodes
            .iter()
            .enumerate()
            .map(|(index, &node)| (NodeId::from(index), node))
    }

    /// Returns the name of the node in STN plan files: `.zero`, `n0.start`, `n0.end`, `r`. Timed
    /// initials, which are not part of such files, are `.timed` and their position.
    pub fn node_label(&self, node: NodeId) -> String {
        match self.nodes[node.index()] {
            Node::Zero => ".zero".to_owned(),
            Node::Start(id) => format!("{}.start", self.instance(id).label),
            Node::End(id) => format!("{}.end", self.instance(id).label),
            Node::Instant(id) => self.instance(id).label.clone(),
            Node::Timed(index) => format!(".timed{index}"),
        }
    }

    /// Returns the node in words: `start of (move a b)`, `timed initials at 5`.
    pub fn describe_node(&self, task: &Task, node: NodeId) -> String {
        self.describe_node_from(task, node, &Rational::ZERO)
    }

    /// Like [`StnPlan::describe_node`]; the times of timed initials are on a clock that reads
    /// `origin` when the task's clock reads 0.
    pub fn describe_node_from(&self, task: &Task, node: NodeId, origin: &Rational) -> String {
        match self.nodes[node.index()] {
            Node::Zero => "the beginning of the plan".to_owned(),
            Node::Start(id) => format!("start of {}", self.instance(id).action.name),
            Node::End(id) => format!("end of {}", self.instance(id).action.name),
            Node::Instant(id) => self.instance(id).action.name.clone(),
            Node::Timed(index) => {
                let time = origin + &task.timed()[index].time;
                format!("timed initials at {}", time.to_decimal(3))
            }
        }
    }

    /// Returns the reads and writes of the happening at the node.
    pub fn footprint(&self, task: &Task, node: NodeId) -> Footprint {
        match self.nodes[node.index()] {
            Node::Zero => Footprint::default(),
            Node::Start(id) | Node::Instant(id) => {
                Footprint::of_start(task, &self.instance(id).action)
            }
            Node::End(id) => Footprint::of_end(task, &self.instance(id).action),
            Node::Timed(index) => Footprint::of_timed(&task.timed()[index]),
        }
    }
}
