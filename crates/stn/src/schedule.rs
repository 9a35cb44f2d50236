//! Schedules: a time for each node.

use std::ops::Index;

use elbowroom_num::Rational;

use crate::{NodeId, Weight};

/// A time for each node of a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schedule<W = Rational> {
    times: Vec<W>,
}

impl<W: Weight> Schedule<W> {
    /// Creates the schedule with node `NodeId(i)` at `times[i]`.
    pub fn new(times: Vec<W>) -> Self {
        Self { times }
    }

    /// Returns the times, by node.
    pub fn times(&self) -> &[W] {
        &self.times
    }

    /// Returns the times, by node.
    pub fn into_times(self) -> Vec<W> {
        self.times
    }

    /// Returns the same schedule, shifted so that `origin` happens at zero.
    #[must_use]
    pub fn relative_to(&self, origin: NodeId) -> Self {
        let zero = &self[origin];
        Self {
            times: self.times.iter().map(|time| time.minus(zero)).collect(),
        }
    }

    pub(crate) fn set(&mut self, node: NodeId, time: W) {
        self.times[node.index()] = time;
    }

    pub(crate) fn resize(&mut self, node_count: usize) {
        self.times.resize_with(node_count, W::zero);
    }
}

impl<W> Index<NodeId> for Schedule<W> {
    type Output = W;
    fn index(&self, node: NodeId) -> &W {
        &self.times[node.index()]
    }
}
