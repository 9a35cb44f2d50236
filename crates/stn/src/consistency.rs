//! Consistency check: the algorithm of Bellman, Ford and Moore with Tarjan's subtree disassembly.

use std::collections::VecDeque;
use std::fmt;

use elbowroom_num::Rational;

use crate::{ConstraintId, Network, NodeId, Schedule, Weight, count_step};

/// Proof that a network is inconsistent: a cycle of constraints that sum up to `0 <= total < 0`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NegativeCycle<W = Rational> {
    /// Edges of the cycle, in order.
    pub constraints: Vec<ConstraintId>,
    /// The sum of their bounds. At least one of them must be relaxed, by `-total` in all.
    pub total: W,
}

impl<W: Weight> NegativeCycle<W> {
    /// Returns `true` if these constraints of `network` form a cycle whose bounds sum up to `total
    /// < 0`.
    pub fn holds_in(&self, network: &Network<W>) -> bool {
        let edges = || self.constraints.iter().map(|&id| network.constraint(id));
        let nexts = edges().skip(1).chain(edges().take(1));
        let is_circle = edges().zip(nexts).all(|(edge, next)| edge.to == next.from);
        let sum = edges().fold(W::zero(), |sum, edge| sum.plus(&edge.bound));
        is_circle && sum == self.total && self.total < W::zero()
    }
}

impl<W: fmt::Debug> fmt::Display for NegativeCycle<W> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let length = self.constraints.len();
        write!(
            f,
            "{length} constraints contradict each other by {:?}",
            self.total
        )
    }
}

impl<W: fmt::Debug> std::error::Error for NegativeCycle<W> {}

impl<W: Weight> Network<W> {
    /// Returns a schedule, or a proof that there is none. Worst case nodes · constraints; near
    /// linear on networks of plans.
    ///
    /// The schedule is the latest one with no node after time zero.
    ///
    /// # Errors
    /// A cycle of negative length.
    pub fn consistency(&self) -> Result<Schedule<W>, NegativeCycle<W>> {
        let mut schedule = Schedule::new(vec![W::zero(); self.node_count()]);
        let mut tree = Tree::star(self.node_count());
        let mut queue: VecDeque<NodeId> = self.late_nodes_first().into();
        while let Some(node) = queue.pop_front() {
            count_step();
            if !std::mem::take(&mut tree.is_queued[node.index()]) {
                continue;
            }
            for id in self.leaving(node) {
                let constraint = self.constraint(id);
                let limit = schedule[node].plus(&constraint.bound);
                if limit >= schedule[constraint.to] {
                    continue;
                }
                if tree.detach_subtree(constraint.to, node) {
                    let constraints = tree.path(self, constraint.to, node, id);
                    let total = limit.minus(&schedule[constraint.to]);
                    return Err(NegativeCycle { constraints, total });
                }
                schedule.set(constraint.to, limit);
                tree.attach(constraint.to, node, id);
                if !std::mem::replace(&mut tree.is_queued[constraint.to.index()], true) {
                    queue.push_back(constraint.to);
                }
            }
        }
        Ok(schedule)
    }

    /// Returns all nodes, ordered so that `from` comes before `to` for as many negative bounds as
    /// possible.
    ///
    /// Negative bounds are precedences and rarely form cycles. In this order one sweep over the
    /// nodes processes nearly everything.
    fn late_nodes_first(&self) -> Vec<NodeId> {
        let is_negative = |id: ConstraintId| self.constraint(id).bound < W::zero();
        let mut finished = self.depth_first_postorder(is_negative);
        finished.reverse();
        finished
    }
}

/// Tree of shortest paths so far, under an artificial root that precedes every node.
///
/// Invariant: along every edge of the tree, `schedule[to] = schedule[from] + bound`. To keep it, a
/// node whose time decreases loses its subtree (Tarjan 1981): the nodes in it will be improved
/// anyway, and if the node that caused the decrease is among them, there is a negative cycle.
struct Tree {
    /// Edge from the parent of a node; `None` for children of the root.
    via: Vec<Option<ConstraintId>>,
    /// The distance from the root; `None` for detached nodes.
    depth: Vec<Option<u32>>,
    /// The nodes of the tree in depth-first order, as a ring through the root.
    next: Vec<usize>,
    previous: Vec<usize>,
    /// `true` if a node is waiting to be processed; detached nodes need not be processed.
    is_queued: Vec<bool>,
}

impl Tree {
    /// Creates a tree with all nodes as children of the root, and all of them queued.
    fn star(node_count: usize) -> Self {
        let root = node_count;
        let ring = node_count + 1;
        let mut depth = vec![Some(1); ring];
        depth[root] = Some(0);
        Self {
            via: vec![None; node_count],
            depth,
            next: (0..ring).map(|place| (place + 1) % ring).collect(),
            previous: (0..ring).map(|place| (place + node_count) % ring).collect(),
            is_queued: vec![true; node_count],
        }
    }

    /// Detaches `node` and its subtree. Returns `true` if `cause` is in it.
    fn detach_subtree(&mut self, node: NodeId, cause: NodeId) -> bool {
        if node == cause {
            return true;
        }
        let Some(depth) = self.depth[node.index()] else {
            return false;
        };
        let before = self.previous[node.index()];
        let mut place = self.next[node.index()];
        while self.depth[place].is_some_and(|below| below > depth) {
            if place == cause.index() {
                return true;
            }
            self.depth[place] = None;
            self.is_queued[place] = false;
            place = self.next[place];
        }
        self.next[before] = place;
        self.previous[place] = before;
        false
    }

    /// Attaches the detached node `node` to `parent`.
    fn attach(&mut self, node: NodeId, parent: NodeId, via: ConstraintId) {
        let (node, parent) = (node.index(), parent.index());
        let after = std::mem::replace(&mut self.next[parent], node);
        self.previous[after] = node;
        self.next[node] = after;
        self.previous[node] = parent;
        self.depth[node] = self.depth[parent].map(|depth| depth + 1);
        self.via[node] = Some(via);
    }

    /// Returns the tree's path from `top` down to `bottom`, then the edge `last`.
    fn path<W: Weight>(
        &self,
        network: &Network<W>,
        top: NodeId,
        bottom: NodeId,
        last: ConstraintId,
    ) -> Vec<ConstraintId> {
        let mut path = vec![last];
        let mut node = bottom;
        while node != top {
            let id = self.via[node.index()].expect("`bottom` is in the subtree of `top`");
            path.push(id);
            node = network.constraint(id).from;
        }
        path.reverse();
        path
    }
}
