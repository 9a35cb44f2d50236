//! Time points and the constraints between them.

use elbowroom_num::Rational;

use crate::lists::Lists;
use crate::{ConstraintId, Direction, NodeId, Schedule, Weight};

/// The constraint `to - from <= bound`, or the edge `from --bound--> to`.
///
/// It means "`to` at most `bound` after `from`", or for a negative `bound`, "`to` at least `-bound`
/// before `from`".
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constraint<W = Rational> {
    /// Source of the edge: the time point that is subtracted.
    pub from: NodeId,
    /// Target of the edge.
    pub to: NodeId,
    /// The upper bound of the difference.
    pub bound: W,
}

impl<W: Weight> Constraint<W> {
    /// Returns the constraint `to - from <= bound`.
    pub fn at_most(from: NodeId, to: NodeId, bound: W) -> Self {
        Self { from, to, bound }
    }

    /// Returns the constraint `to - from >= bound`, which is `from - to <= -bound`.
    #[allow(
        clippy::needless_pass_by_value,
        reason = "both constructors take the bound alike"
    )]
    pub fn at_least(from: NodeId, to: NodeId, bound: W) -> Self {
        Self {
            from: to,
            to: from,
            bound: bound.negated(),
        }
    }

    /// Returns `true` if `schedule[to] - schedule[from] <= bound`.
    pub fn holds_in(&self, schedule: &Schedule<W>) -> bool {
        schedule[self.to] <= schedule[self.from].plus(&self.bound)
    }

    /// Returns the slack `schedule[from] + bound - schedule[to]`, which is negative if the
    /// constraint is violated.
    ///
    /// With slacks as lengths, the length of a path changes only by the times of its two ends. If
    /// all constraints hold, no length is negative.
    pub fn slack_in(&self, schedule: &Schedule<W>) -> W {
        schedule[self.from]
            .plus(&self.bound)
            .minus(&schedule[self.to])
    }
}

/// Time points and constraints `to - from <= bound` between them. May be inconsistent.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network<W = Rational> {
    constraints: Vec<Constraint<W>>,
    /// For each node, the constraints whose `from` it is.
    leaving: Lists,
    /// For each node, the constraints whose `to` it is.
    entering: Lists,
}

impl<W> Default for Network<W> {
    fn default() -> Self {
        Self {
            constraints: Vec::new(),
            leaving: Lists::default(),
            entering: Lists::default(),
        }
    }
}

impl<W: Weight> Network<W> {
    /// Creates a network without nodes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a network with `node_count` nodes and no constraints.
    pub fn with_nodes(node_count: usize) -> Self {
        Self {
            constraints: Vec::new(),
            leaving: Lists::with_nodes(node_count),
            entering: Lists::with_nodes(node_count),
        }
    }

    /// Adds a time point without constraints.
    pub fn add_node(&mut self) -> NodeId {
        let node = NodeId::from_index(self.node_count());
        self.leaving.add_node();
        self.entering.add_node();
        node
    }

    /// Adds a constraint between two nodes of the network.
    pub fn add(&mut self, constraint: Constraint<W>) -> ConstraintId {
        let id = ConstraintId::from_index(self.constraints.len());
        self.leaving.push(constraint.from);
        self.entering.push(constraint.to);
        self.constraints.push(constraint);
        id
    }

    /// Replaces the bound of a constraint.
    pub(crate) fn set_bound(&mut self, id: ConstraintId, bound: W) {
        self.constraints[id.index()].bound = bound;
    }

    /// Returns the number of nodes; the nodes are `NodeId(0)`, `NodeId(1)`, and so on.
    pub fn node_count(&self) -> usize {
        self.leaving.node_count()
    }

    /// Returns all nodes.
    pub fn nodes(&self) -> impl ExactSizeIterator<Item = NodeId> + use<W> {
        (0..self.node_count()).map(NodeId::from_index)
    }

    /// Returns the constraint with that identifier.
    pub fn constraint(&self, id: ConstraintId) -> &Constraint<W> {
        &self.constraints[id.index()]
    }

    /// Returns all constraints, indexed by `ConstraintId`.
    pub fn constraints(&self) -> &[Constraint<W>] {
        &self.constraints
    }

    /// Returns the identifiers of all constraints.
    pub fn constraint_ids(&self) -> impl ExactSizeIterator<Item = ConstraintId> + use<W> {
        (0..self.constraints.len()).map(ConstraintId::from_index)
    }

    /// Returns the constraints whose `from` is `node`, in the order they were added.
    pub fn leaving(&self, node: NodeId) -> impl Iterator<Item = ConstraintId> + '_ {
        self.leaving.of(node)
    }

    /// Returns the constraints whose `to` is `node`, in the order they were added.
    pub fn entering(&self, node: NodeId) -> impl Iterator<Item = ConstraintId> + '_ {
        self.entering.of(node)
    }

    /// Returns the first constraint to follow from `node` in that direction.
    pub(crate) fn first(&self, node: NodeId, direction: Direction) -> Option<ConstraintId> {
        self.lists(direction).first(node)
    }

    /// Returns the next constraint after `id`.
    pub(crate) fn after(&self, id: ConstraintId, direction: Direction) -> Option<ConstraintId> {
        self.lists(direction).after(id)
    }

    fn lists(&self, direction: Direction) -> &Lists {
        match direction {
            Direction::FromRoot => &self.leaving,
            Direction::ToRoot => &self.entering,
        }
    }

    /// Returns the network without the constraints `left_out`; the others keep their order.
    ///
    /// `left_out` is sorted, as [`implied`](crate::ConsistentNetwork::implied) returns it.
    #[must_use]
    pub fn without(&self, left_out: &[ConstraintId]) -> Self {
        debug_assert!(left_out.is_sorted());
        let mut rest = Self::with_nodes(self.node_count());
        for id in self.constraint_ids() {
            if left_out.binary_search(&id).is_err() {
                rest.add(self.constraint(id).clone());
            }
        }
        rest
    }

    /// Returns all nodes in postorder of a depth-first search along the edges for which
    /// `is_followed` holds: without cycles of such edges, `to` comes before `from`.
    pub(crate) fn depth_first_postorder(
        &self,
        is_followed: impl Fn(ConstraintId) -> bool,
    ) -> Vec<NodeId> {
        let mut finished = Vec::with_capacity(self.node_count());
        let mut is_seen = vec![false; self.node_count()];
        // Nodes, each with the next constraint to visit.
        let mut path: Vec<(NodeId, Option<ConstraintId>)> = Vec::new();
        for root in self.nodes() {
            if !std::mem::replace(&mut is_seen[root.index()], true) {
                path.push((root, self.leaving.first(root)));
            }
            while let Some((node, next)) = path.last_mut() {
                let Some(id) = *next else {
                    finished.push(*node);
                    path.pop();
                    continue;
                };
                *next = self.leaving.after(id);
                let to = self.constraint(id).to;
                if is_followed(id) && !std::mem::replace(&mut is_seen[to.index()], true) {
                    path.push((to, self.leaving.first(to)));
                }
            }
        }
        finished
    }

    /// Returns the strongly connected component of each node, whatever the bounds. No edges lead to
    /// components with smaller numbers.
    pub fn components(&self) -> Vec<usize> {
        // Kosaraju's algorithm: in reverse postorder, and against the edges.
        let order = self.depth_first_postorder(|_| true);
        let mut component = vec![usize::MAX; self.node_count()];
        for (number, &root) in order.iter().rev().enumerate() {
            let mut stack = vec![root];
            while let Some(node) = stack.pop() {
                if component[node.index()] == usize::MAX {
                    component[node.index()] = number;
                    stack.extend(self.entering(node).map(|id| self.constraint(id).from));
                }
            }
        }
        component
    }

    /// Removes the last constraints and nodes until these numbers remain.
    ///
    /// No remaining constraint may mention a removed node.
    pub(crate) fn truncate(&mut self, node_count: usize, constraint_count: usize) {
        while self.constraints.len() > constraint_count {
            if let Some(constraint) = self.constraints.pop() {
                self.leaving.pop(constraint.from);
                self.entering.pop(constraint.to);
            }
        }
        self.leaving.truncate(node_count);
        self.entering.truncate(node_count);
    }
}

impl<W: Weight> Schedule<W> {
    /// Returns `true` if every constraint of `network` holds.
    pub fn holds_in(&self, network: &Network<W>) -> bool {
        self.times().len() == network.node_count()
            && network
                .constraints()
                .iter()
                .all(|constraint| constraint.holds_in(self))
    }
}
