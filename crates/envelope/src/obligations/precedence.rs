//! Which nodes of a plan come first whatever the values: [`Precedence`].

use std::collections::BTreeSet;

use elbowroom_num::End;
use elbowroom_plan::{Bound, NodeId, ParametrizedPlan};

/// The nodes that come no later than others in all schedules, for all values in the parameters'
/// ranges: those from which bounds of at least zero lead there. There may be more of them.
pub(super) struct Precedence {
    before: Vec<Vec<NodeId>>,
    after: Vec<Vec<NodeId>>,
}

impl Precedence {
    pub(super) fn of(plan: &ParametrizedPlan) -> Self {
        let count = plan.plan.nodes.len();
        let mut precedence = Self {
            before: vec![Vec::new(); count],
            after: vec![Vec::new(); count],
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

    /// The nodes that come no later than this one, which is among them.
    pub(super) fn not_after(&self, node: NodeId) -> BTreeSet<NodeId> {
        reached(&self.before, node)
    }

    /// The nodes that come no earlier than this one, which is among them.
    pub(super) fn not_before(&self, node: NodeId) -> BTreeSet<NodeId> {
        reached(&self.after, node)
    }
}

fn reached(next: &[Vec<NodeId>], from: NodeId) -> BTreeSet<NodeId> {
    let mut reached = BTreeSet::from([from]);
    let mut open = vec![from];
    while let Some(node) = open.pop() {
        for &other in &next[node.index()] {
            if reached.insert(other) {
                open.push(other);
            }
        }
    }
    reached
}
