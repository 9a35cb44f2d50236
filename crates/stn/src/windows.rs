//! Time windows of nodes, relative to an origin.

use std::ops::Index;

use elbowroom_num::Rational;

use crate::{ConsistentNetwork, NodeId, Schedule, ShortestPaths, Weight};

/// Time window: exactly the times `earliest <= node - origin <= latest` occur in schedules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window<W = Rational> {
    /// Earliest time; `None` if it is unbounded.
    pub earliest: Option<W>,
    /// Latest time; `None` if it is unbounded.
    pub latest: Option<W>,
}

/// The [`Window`] of each node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Windows<W = Rational> {
    origin: NodeId,
    windows: Vec<Window<W>>,
}

impl<W: Weight> Windows<W> {
    /// Returns the node that times are relative to.
    pub fn origin(&self) -> NodeId {
        self.origin
    }

    /// Returns all windows, by node.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = (NodeId, &Window<W>)> {
        let numbered = self.windows.iter().enumerate();
        numbered.map(|(index, window)| (NodeId::from_index(index), window))
    }
}

impl<W> Index<NodeId> for Windows<W> {
    type Output = Window<W>;
    fn index(&self, node: NodeId) -> &Window<W> {
        &self.windows[node.index()]
    }
}

impl<W: Weight> ConsistentNetwork<W> {
    /// Computes the window of each node relative to `origin`, by two runs of Dijkstra's algorithm.
    pub fn windows(&self, origin: NodeId) -> Windows<W> {
        let after = self.shortest_paths_from(origin);
        let before = self.shortest_paths_to(origin);
        let window = |node| Window {
            earliest: before.distance(node).map(W::negated),
            latest: after.distance(node).cloned(),
        };
        Windows {
            origin,
            windows: self.network().nodes().map(window).collect(),
        }
    }

    /// Returns the schedule with `origin` at zero and every other node as early as possible.
    ///
    /// Nodes without an earliest time are so early that all constraints hold.
    pub fn earliest_schedule(&self, origin: NodeId) -> Schedule<W> {
        self.extreme_schedule(&self.shortest_paths_to(origin), W::negated)
    }

    /// Returns the schedule with `origin` at zero and every other node as late as possible.
    ///
    /// Nodes without a latest time are so late that all constraints hold.
    pub fn latest_schedule(&self, origin: NodeId) -> Schedule<W> {
        self.extreme_schedule(&self.shortest_paths_from(origin), W::clone)
    }

    /// Puts bounded nodes at `time(distance)`, and shifts the others together from the known
    /// schedule.
    ///
    /// A constraint between a bounded and an unbounded node can only pull the unbounded one away
    /// from the origin: if it pushed, both would be bounded. So one long shift satisfies all of
    /// them.
    fn extreme_schedule(&self, paths: &ShortestPaths<W>, time: fn(&W) -> W) -> Schedule<W> {
        let bounded = |node| paths.distance(node).map(time);
        let mut shift = W::zero();
        for constraint in self.network().constraints() {
            let (from, to) = (bounded(constraint.from), bounded(constraint.to));
            match (from, to) {
                // `to` must decrease to `from + bound`.
                (Some(from), None) => {
                    let limit = from.plus(&constraint.bound);
                    shift = shift.min(limit.minus(&self.schedule()[constraint.to]));
                }
                // `from` must increase to `to - bound`.
                (None, Some(to)) => {
                    let limit = to.minus(&constraint.bound);
                    shift = shift.max(limit.minus(&self.schedule()[constraint.from]));
                }
                _ => {}
            }
        }
        let unbounded = |node| self.schedule()[node].plus(&shift);
        let times = self.network().nodes();
        Schedule::new(
            times
                .map(|node| bounded(node).unwrap_or_else(|| unbounded(node)))
                .collect(),
        )
    }
}
