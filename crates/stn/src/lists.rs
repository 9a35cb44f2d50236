//! Lists of constraints, one for each node.

use crate::{ConstraintId, NodeId};

/// The constraints that begin (or end) at each node, in the order they were added.
///
/// The lists are linked through the constraints, so that a constant number of allocations is enough
/// for any number of nodes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Lists {
    /// For each node, its first and its last constraint.
    ends: Vec<Option<(ConstraintId, ConstraintId)>>,
    /// For each constraint, the ones before and after it in its list.
    neighbours: Vec<(Option<ConstraintId>, Option<ConstraintId>)>,
}

impl Lists {
    /// Creates an empty list for each of `node_count` nodes.
    pub(crate) fn with_nodes(node_count: usize) -> Self {
        Self {
            ends: vec![None; node_count],
            neighbours: Vec::new(),
        }
    }

    pub(crate) fn node_count(&self) -> usize {
        self.ends.len()
    }

    pub(crate) fn add_node(&mut self) {
        self.ends.push(None);
    }

    /// Appends the next constraint to a node's list.
    pub(crate) fn push(&mut self, node: NodeId) {
        let id = ConstraintId::from_index(self.neighbours.len());
        let ends = &mut self.ends[node.index()];
        let last = ends.map(|(_, last)| last);
        *ends = Some((ends.map_or(id, |(first, _)| first), id));
        if let Some(last) = last {
            self.neighbours[last.index()].1 = Some(id);
        }
        self.neighbours.push((last, None));
    }

    /// Removes the newest constraint, which is the last in its node's list.
    pub(crate) fn pop(&mut self, node: NodeId) {
        let Some((before, _)) = self.neighbours.pop() else {
            return;
        };
        let ends = &mut self.ends[node.index()];
        match before {
            None => *ends = None,
            Some(before) => {
                self.neighbours[before.index()].1 = None;
                *ends = ends.map(|(first, _)| (first, before));
            }
        }
    }

    /// Removes the nodes from that number on, whose lists are empty.
    pub(crate) fn truncate(&mut self, node_count: usize) {
        self.ends.truncate(node_count);
    }

    /// Returns the first constraint of a node's list.
    pub(crate) fn first(&self, node: NodeId) -> Option<ConstraintId> {
        self.ends[node.index()].map(|(first, _)| first)
    }

    /// Returns the next constraint in the same list.
    pub(crate) fn after(&self, id: ConstraintId) -> Option<ConstraintId> {
        self.neighbours[id.index()].1
    }

    /// Returns a node's list.
    pub(crate) fn of(&self, node: NodeId) -> impl Iterator<Item = ConstraintId> + '_ {
        std::iter::successors(self.first(node), |&id| self.after(id))
    }
}
