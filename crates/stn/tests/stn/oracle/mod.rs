//! Bellman and Ford's algorithm, in its simplest form.

use elbowroom_stn::{Network, NodeId, Weight};

/// Returns distances from `root`, or `None` if there is a negative cycle.
pub(crate) fn distances<W: Weight>(network: &Network<W>, root: NodeId) -> Option<Vec<Option<W>>> {
    let mut distances: Vec<Option<W>> = vec![None; network.node_count()];
    distances[root.index()] = Some(W::zero());
    for _ in 0..=network.node_count() {
        let mut is_settled = true;
        for constraint in network.constraints() {
            let Some(near) = &distances[constraint.from.index()] else {
                continue;
            };
            let distance = near.plus(&constraint.bound);
            let far = &mut distances[constraint.to.index()];
            if far.as_ref().is_none_or(|far| distance < *far) {
                *far = Some(distance);
                is_settled = false;
            }
        }
        if is_settled {
            return Some(distances);
        }
    }
    None
}

/// Returns distances between all pairs, or `None` if the network is inconsistent.
pub(crate) fn all_distances<W: Weight>(network: &Network<W>) -> Option<Vec<Vec<Option<W>>>> {
    network
        .nodes()
        .map(|root| distances(network, root))
        .collect()
}
