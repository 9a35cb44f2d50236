//! When each node may happen, seen from an origin.

use std::ops::Index;

use elbowroom_num::Rational;

use crate::{ConsistentNetwork, NodeId, Schedule, ShortestPaths, Weight};

/// The times `earliest <= node - origin <= latest` that occur in schedules; exactly those.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Window<W = Rational> {
    /// `None`: as early as one likes.
    pub earliest: Option<W>,
    /// `None`: as late as one likes.
    pub latest: Option<W>,
}

/// The [`Window`] of each node.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Windows<W = Rational> {
    origin: NodeId,
    windows: Vec<Window<W>>,
}

impl<W: Weight> Windows<W> {
    /// The node that times are relative to.
    pub fn origin(&self) -> NodeId {
        self.origin
    }

    /// All windows, by node.
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
    /// When each node may happen relative to `origin`: two runs of Dijkstra's algorithm.
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

    /// `origin` at zero and every other node as early as it may be.
    ///
    /// Nodes that may be as early as one likes lie so early that everything holds.
    pub fn earliest_schedule(&self, origin: NodeId) -> Schedule<W> {
        self.extreme_schedule(&self.shortest_paths_to(origin), W::negated)
    }

    /// `origin` at zero and every other node as late as it may be.
    ///
    /// Nodes that may be as late as one likes lie so late that everything holds.
    pub fn latest_schedule(&self, origin: NodeId) -> Schedule<W> {
        self.extreme_schedule(&self.shortest_paths_from(origin), W::clone)
    }

    /// Bounded nodes at `time(distance)`; the others as in the known schedule, moved as one.
    ///
    /// A constraint between a bounded and an unbounded node can only pull the unbounded one away
    /// from the origin: if it pushed, both would be bounded. So a long move mends all of them.
    fn extreme_schedule(&self, paths: &ShortestPaths<W>, time: fn(&W) -> W) -> Schedule<W> {
        let bounded = |node| paths.distance(node).map(time);
        let mut shift = W::zero();
        for constraint in self.network().constraints() {
            let (from, to) = (bounded(constraint.from), bounded(constraint.to));
            match (from, to) {
                // `to` must come down to `from + bound`.
                (Some(from), None) => {
                    let limit = from.plus(&constraint.bound);
                    shift = shift.min(limit.minus(&self.schedule()[constraint.to]));
                }
                // `from` must come up to `to - bound`.
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
