//! Order of nodes that is the same for all values: [`Precedence`].

use std::collections::BTreeSet;

use elbowroom_num::End;
use elbowroom_plan::{Bound, NodeId, ParametrizedPlan, Schedule};

/// Nodes that come no later than others in all schedules, for all values in the parameters' ranges,
/// by chains of bounds of at least zero. The relation may be incomplete.
#[derive(Debug)]
pub(super) struct Precedence {
    before: Vec<Vec<NodeId>>,
    after: Vec<Vec<NodeId>>,
    /// The rank of each node's time in a schedule for values in the ranges, which satisfies all
    /// these bounds.
    ranks: Vec<usize>,
}

impl Precedence {
    /// Computes the relation of a plan with this schedule and the order of its nodes.
    pub(super) fn of(plan: &ParametrizedPlan, order: &[NodeId], schedule: &Schedule) -> Self {
        let count = plan.plan.nodes.len();
        let mut ranks = vec![0; count];
        let (mut rank, mut earlier) = (0, None);
        for &node in order {
            if earlier.is_some_and(|earlier| schedule[earlier] != schedule[node]) {
                rank += 1;
            }
            ranks[node.index()] = rank;
            earlier = Some(node);
        }
        let mut precedence = Self {
            before: vec![Vec::new(); count],
            after: vec![Vec::new(); count],
            ranks,
        };
        for constraint in &plan.plan.constraints {
            let is_forward = match &constraint.lower {
                Bound::Finite(least) => !least.is_negative(),
                Bound::Parameter(id) => match &plan.parameter(*id).range.lower {
                    End::Closed(least) | End::Open(least) => !least.is_negative(),
                    End::Infinite => false,
                },
                Bound::Infinite => false,
            };
            if is_forward {
                precedence.after[constraint.from.index()].push(constraint.to);
                precedence.before[constraint.to.index()].push(constraint.from);
            }
            if matches!(&constraint.upper, Bound::Finite(most) if !most.is_positive()) {
                precedence.after[constraint.to.index()].push(constraint.from);
                precedence.before[constraint.from.index()].push(constraint.to);
            }
        }
        precedence
    }

    /// Sorts nodes by their times.
    pub(super) fn in_order(&self, nodes: BTreeSet<NodeId>) -> Vec<NodeId> {
        let mut nodes = Vec::from_iter(nodes);
        nodes.sort_by_key(|node| (self.ranks[node.index()], *node));
        nodes
    }

    /// Returns the nodes known to be before or after the moments inside an action.
    pub(super) fn around(&self, start: NodeId, end: NodeId) -> Around<'_> {
        let cone = |next, from: NodeId| Cone {
            next,
            reached: BTreeSet::from([from]),
            open: BTreeSet::from([(self.ranks[from.index()], from)]),
        };
        Around {
            ranks: &self.ranks,
            start,
            happened: cone(&self.before, start),
            to_come: cone(&self.after, end),
        }
    }
}

/// A side of the moments inside an action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Before,
    After,
}

/// Nodes that come no later than the start of an action, and nodes that come no earlier than its
/// end. Computed lazily, as far as queries need.
pub(super) struct Around<'a> {
    ranks: &'a [usize],
    start: NodeId,
    happened: Cone<'a>,
    to_come: Cone<'a>,
}

impl Around<'_> {
    /// Returns the side that the node is on in every schedule, if bounds imply one.
    pub(super) fn side(&mut self, node: NodeId) -> Option<Side> {
        let ranks = self.ranks;
        let rank = ranks[node.index()];
        if self.is_not_after_start(node) {
            let happened = &mut self.happened;
            while let Some(&(own, next)) = happened.open.last()
                && own >= rank
            {
                happened.open.pop_last();
                happened.follow(next, ranks);
            }
            if happened.reached.contains(&node) {
                return Some(Side::Before);
            }
        }
        let to_come = &mut self.to_come;
        while let Some(&(own, next)) = to_come.open.first()
            && own <= rank
        {
            to_come.open.pop_first();
            to_come.follow(next, ranks);
        }
        to_come.reached.contains(&node).then_some(Side::After)
    }

    /// Returns `true` if the node comes no later than the action's start in the reference schedule.
    pub(super) fn is_not_after_start(&self, node: NodeId) -> bool {
        self.ranks[node.index()] <= self.ranks[self.start.index()]
    }
}

/// Nodes that are reachable by bounds from one node, in one direction of time.
struct Cone<'a> {
    next: &'a [Vec<NodeId>],
    reached: BTreeSet<NodeId>,
    /// Reached nodes that have not been expanded yet, by rank.
    open: BTreeSet<(usize, NodeId)>,
}

impl Cone<'_> {
    fn follow(&mut self, node: NodeId, ranks: &[usize]) {
        for &other in &self.next[node.index()] {
            if self.reached.insert(other) {
                self.open.insert((ranks[other.index()], other));
            }
        }
    }
}
