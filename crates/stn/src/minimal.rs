//! All implied bounds at once.

use elbowroom_num::Rational;

use crate::{ConsistentNetwork, NodeId, Weight};

/// Minimal network: the tightest bound on the difference of each two nodes. Memory grows with the
/// square of the number of nodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Minimal<W = Rational> {
    node_count: usize,
    /// Row by row, by `from`.
    distances: Vec<Option<W>>,
}

impl<W: Weight> Minimal<W> {
    /// Returns the least `d` with `to - from <= d` in every schedule; `None` when there is none.
    pub fn distance(&self, from: NodeId, to: NodeId) -> Option<&W> {
        self.distances[from.index() * self.node_count + to.index()].as_ref()
    }

    /// Returns the number of nodes.
    pub fn node_count(&self) -> usize {
        self.node_count
    }
}

impl<W: Weight> ConsistentNetwork<W> {
    /// Computes the minimal network by Johnson's algorithm, with one run of Dijkstra's per node.
    pub fn minimal(&self) -> Minimal<W> {
        let network = self.network();
        let mut distances = Vec::with_capacity(network.node_count() * network.node_count());
        for from in network.nodes() {
            let paths = self.shortest_paths_from(from);
            distances.extend(network.nodes().map(|to| paths.distance(to).cloned()));
        }
        Minimal {
            node_count: network.node_count(),
            distances,
        }
    }
}
