//! Precomputed order of nodes that is the same in every execution: [`Order`].

use crate::NodeId;

/// Limit on chains: each takes one number per node.
const MAX_CHAINS: usize = 64;

/// Order of nodes: chains of nodes that follow each other, and for each node the last node of each
/// chain that precedes it.
///
/// Incomplete for nodes that fit into no chain, and for nodes on a cycle.
#[derive(Clone, Debug)]
pub(super) struct Order {
    /// For each node, its chain and its position there, from 1.
    places: Vec<Option<(usize, u32)>>,
    /// For each node and chain, the last position that precedes it, or its own; 0 for none.
    latest: Vec<[u32; MAX_CHAINS]>,
}

impl Order {
    /// Computes the order from the direct predecessors of each node.
    pub(super) fn new(earlier: &[Vec<NodeId>]) -> Self {
        let count = earlier.len();
        let mut later: Vec<Vec<usize>> = vec![Vec::new(); count];
        for (node, before) in earlier.iter().enumerate() {
            for first in before {
                later[first.index()].push(node);
            }
        }
        let mut missing: Vec<usize> = earlier.iter().map(Vec::len).collect();
        let mut order = Self {
            places: vec![None; count],
            latest: vec![[0; MAX_CHAINS]; count],
        };
        let mut lengths: Vec<u32> = Vec::new();
        let mut ready: Vec<usize> = (0..count).filter(|&node| missing[node] == 0).collect();
        let mut next = 0;
        while let Some(&node) = ready.get(next) {
            next += 1;
            order.place(node, &earlier[node], &later, &mut lengths);
            for &other in &later[node] {
                missing[other] -= 1;
                if missing[other] == 0 {
                    ready.push(other);
                }
            }
        }
        order
    }

    /// Appends a node to a chain whose last node precedes it, or begins a new chain if the limit
    /// allows.
    fn place(
        &mut self,
        node: usize,
        before: &[NodeId],
        later: &[Vec<usize>],
        lengths: &mut Vec<u32>,
    ) {
        let mut latest = [0; MAX_CHAINS];
        for first in before {
            for (own, theirs) in latest.iter_mut().zip(&self.latest[first.index()]) {
                *own = (*own).max(*theirs);
            }
        }
        let is_last = |chain: usize, place: u32| lengths[chain] == place;
        // Prefers the predecessor with the fewest other successors, because those need chains as
        // well.
        let direct = before.iter().map(|first| first.index());
        let direct = direct.filter_map(|first| {
            let (chain, place) = self.places[first]?;
            is_last(chain, place).then_some((later[first].len(), chain))
        });
        let any = || (0..lengths.len()).find(|&chain| is_last(chain, latest[chain]));
        let chain = direct.min().map(|(_, chain)| chain).or_else(any);
        let chain = chain.or_else(|| {
            lengths.push(0);
            Some(lengths.len() - 1).filter(|&chain| chain < MAX_CHAINS)
        });
        lengths.truncate(MAX_CHAINS);
        if let Some(chain) = chain {
            lengths[chain] += 1;
            latest[chain] = lengths[chain];
            self.places[node] = Some((chain, lengths[chain]));
        }
        self.latest[node] = latest;
    }

    /// Returns `true` if one node is known to come after the other.
    pub(super) fn is_after(&self, later: NodeId, first: NodeId) -> bool {
        let place = self.places[first.index()];
        later != first
            && place.is_some_and(|(chain, place)| self.latest[later.index()][chain] >= place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Each node comes after some nodes with smaller numbers, or, with cycles, after any nodes.
        #[test]
        fn known_order_is_correct_and_complete_for_narrow_orders(
            edges in prop::collection::vec((0..40_usize, 0..40_usize), 0..80),
            has_circles in any::<bool>(),
        ) {
            let mut earlier: [Vec<NodeId>; 40] = std::array::from_fn(|_| Vec::new());
            for (first, later) in edges {
                if has_circles || first < later {
                    earlier[later].push(NodeId(u32::try_from(first).unwrap_or(0)));
                }
            }
            let order = Order::new(&earlier);
            for later in 0..40 {
                let mut reached = [false; 40];
                let mut open = vec![later];
                while let Some(node) = open.pop() {
                    for first in &earlier[node] {
                        if !std::mem::replace(&mut reached[first.index()], true) {
                            open.push(first.index());
                        }
                    }
                }
                for (first, is_reached) in reached.into_iter().enumerate() {
                    let node = |index: usize| NodeId(u32::try_from(index).unwrap_or(0));
                    let found = order.is_after(node(later), node(first));
                    prop_assert!(!found || is_reached);
                    prop_assert!(found || !is_reached || has_circles);
                }
            }
        }
    }
}
