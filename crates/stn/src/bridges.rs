//! Strong bridges: constraints without which one node is no longer reachable from another.

use crate::{Network, NodeId, Weight};

impl<W: Weight> Network<W> {
    /// Returns, for each constraint, `true` if it is a strong bridge: there is a path from its `to`
    /// to its `from`, whatever the bounds, but no path from `from` to `to` without the constraint.
    /// Removing it splits a strongly connected component.
    ///
    /// These are the strong bridges of the graph (Italiano, Laura & Santaroni, *Finding strong
    /// bridges and strong articulation points in linear time*, TCS 2012): an edge is one if all
    /// paths from some node of its component, or all paths to it, contain the edge. Such an edge
    /// dominates its target. Dominators are computed with Semi-NCA (Georgiadis, Tarjan & Werneck,
    /// *Finding dominators in practice*, JGAA 2006), in nearly linear time.
    pub fn strong_bridges(&self) -> Vec<bool> {
        let component = self.components();
        let inner: Vec<bool> = self
            .constraints()
            .iter()
            .map(|own| component[own.from.index()] == component[own.to.index()])
            .collect();
        let mut is_root = vec![true; self.node_count()];
        let mut roots = Vec::new();
        for (node, own) in self.nodes().zip(&component) {
            if std::mem::replace(&mut is_root[*own], false) {
                roots.push(node);
            }
        }
        let mut bridges = vec![false; self.constraints().len()];
        for is_forward in [true, false] {
            let graph = Split::new(self, &inner, is_forward);
            graph.mark_dominating(&roots, &mut bridges);
        }
        bridges
    }
}

/// Network with an additional node in the middle of each constraint inside a component.
struct Split {
    /// Number of nodes of the network. Higher numbers are constraints.
    node_count: usize,
    /// For each node, the position in `next` of its first successor.
    first: Vec<usize>,
    next: Vec<usize>,
    /// Source node of each constraint.
    sources: Vec<usize>,
    /// Target node of each constraint.
    targets: Vec<usize>,
}

impl Split {
    fn new<W: Weight>(network: &Network<W>, inner: &[bool], is_forward: bool) -> Self {
        let node_count = network.node_count();
        let constraints = network.constraints().iter();
        let (sources, targets): (Vec<usize>, Vec<usize>) = constraints
            .map(|own| {
                let (from, to) = (own.from.index(), own.to.index());
                if is_forward { (from, to) } else { (to, from) }
            })
            .unzip();
        let mut first = vec![0; node_count + 1];
        for (source, _) in sources.iter().zip(inner).filter(|(_, inner)| **inner) {
            first[source + 1] += 1;
        }
        for node in 0..node_count {
            first[node + 1] += first[node];
        }
        let mut place = first.clone();
        let mut next = vec![0; first[node_count]];
        for (index, source) in sources.iter().enumerate().filter(|(own, _)| inner[*own]) {
            next[place[*source]] = node_count + index;
            place[*source] += 1;
        }
        Self {
            node_count,
            first,
            next,
            sources,
            targets,
        }
    }

    /// Returns the successors of a node.
    fn leads_to(&self, node: usize) -> &[usize] {
        match node.checked_sub(self.node_count) {
            None => &self.next[self.first[node]..self.first[node + 1]],
            Some(constraint) => std::slice::from_ref(&self.targets[constraint]),
        }
    }

    /// Marks the constraints that are on all paths from the root of their component to their
    /// target.
    fn mark_dominating(&self, roots: &[NodeId], marked: &mut [bool]) {
        let mut tree = Tree::new(self.node_count + self.targets.len());
        for root in roots {
            tree.grow(self, root.index());
        }
        // Predecessors of each node, as numbers of the tree.
        let mut entering: Vec<Vec<usize>> = vec![Vec::new(); tree.nodes.len()];
        for (constraint, target) in self.targets.iter().enumerate() {
            let own = tree.numbers[self.node_count + constraint];
            if own != 0 {
                entering[tree.numbers[*target]].push(own);
                entering[own].push(tree.numbers[self.sources[constraint]]);
            }
        }
        let dominators = tree.dominators(&entering);
        for (number, dominator) in dominators.into_iter().enumerate().skip(1) {
            let is_node = tree.nodes[number] < self.node_count;
            if let (true, Some(constraint)) =
                (is_node, tree.nodes[dominator].checked_sub(self.node_count))
            {
                marked[constraint] = true;
            }
        }
    }
}

/// Depth-first search tree. Nodes are numbered from 1 in order of discovery.
struct Tree {
    /// Number of each node; 0 until it is discovered.
    numbers: Vec<usize>,
    /// Node of each number; entry 0 is unused.
    nodes: Vec<usize>,
    /// For each number, the number of the node that discovered it; 0 for roots.
    parents: Vec<usize>,
}

impl Tree {
    fn new(count: usize) -> Self {
        Self {
            numbers: vec![0; count],
            nodes: vec![0],
            parents: vec![0],
        }
    }

    /// Discovers everything that is reachable from a root.
    fn grow(&mut self, graph: &Split, root: usize) {
        // Nodes, each with the number of its successors that have been visited.
        let mut path = vec![(root, 0)];
        self.discover(root, 0);
        while let Some((node, looked_at)) = path.last_mut() {
            let Some(&next) = graph.leads_to(*node).get(*looked_at) else {
                path.pop();
                continue;
            };
            *looked_at += 1;
            if self.numbers[next] == 0 {
                self.discover(next, self.numbers[*node]);
                path.push((next, 0));
            }
        }
    }

    fn discover(&mut self, node: usize, parent: usize) {
        self.numbers[node] = self.nodes.len();
        self.nodes.push(node);
        self.parents.push(parent);
    }

    /// Returns, for each number, the number of its immediate dominator; 0 for roots.
    fn dominators(&self, entering: &[Vec<usize>]) -> Vec<usize> {
        let count = self.nodes.len();
        let mut semi: Vec<usize> = (0..count).collect();
        let mut label = semi.clone();
        let mut up = self.parents.clone();
        let mut path = Vec::new();
        for own in (1..count).rev().filter(|&own| self.parents[own] != 0) {
            semi[own] = self.parents[own];
            for &from in &entering[own] {
                let least = lowest(from, own + 1, (&semi, &mut label, &mut up), &mut path);
                semi[own] = semi[own].min(semi[least]);
            }
        }
        let mut dominators = self.parents.clone();
        for own in 1..count {
            while dominators[own] > semi[own] {
                dominators[own] = dominators[dominators[own]];
            }
        }
        dominators
    }
}

/// Returns the node with the least semidominator among `node` and its processed ancestors (those
/// numbered from `looked_at` on). Compresses the path to them.
fn lowest(
    node: usize,
    looked_at: usize,
    (semi, label, up): (&[usize], &mut [usize], &mut [usize]),
    path: &mut Vec<usize>,
) -> usize {
    if node < looked_at || up[node] < looked_at {
        return label[node];
    }
    let mut top = node;
    while up[top] >= looked_at {
        path.push(top);
        top = up[top];
    }
    while let Some(own) = path.pop() {
        if semi[label[top]] < semi[label[own]] {
            label[own] = label[top];
        }
        up[own] = up[top];
        top = own;
    }
    label[node]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Constraint;

    fn network(count: usize, edges: &[(usize, usize)]) -> Network<i128> {
        let mut network = Network::with_nodes(count);
        let node = |index: usize| NodeId(u32::try_from(index).unwrap());
        for (from, to) in edges {
            network.add(Constraint {
                from: node(*from),
                to: node(*to),
                bound: 0,
            });
        }
        network
    }

    /// Returns `true` if there is a path from one node to the other without one of the edges.
    fn leads(
        network: &Network<i128>,
        (from, to): (NodeId, NodeId),
        without: Option<usize>,
    ) -> bool {
        let mut seen = vec![false; network.node_count()];
        let mut stack = vec![from];
        while let Some(node) = stack.pop() {
            if node == to {
                return true;
            }
            if !std::mem::replace(&mut seen[node.index()], true) {
                let leaving = network.constraints().iter().enumerate();
                let leaving =
                    leaving.filter(|(index, own)| own.from == node && Some(*index) != without);
                stack.extend(leaving.map(|(_, own)| own.to));
            }
        }
        false
    }

    proptest! {
        #[test]
        fn bridge_has_no_detour(
            count in 1..9_usize,
            edges in prop::collection::vec((0..9_usize, 0..9_usize), 0..24),
        ) {
            let edges: Vec<_> = edges.into_iter().map(|(a, b)| (a % count, b % count)).collect();
            let network = network(count, &edges);
            let bridges = network.strong_bridges();
            for (index, own) in network.constraints().iter().enumerate() {
                let is_bridge = leads(&network, (own.to, own.from), None)
                    && !leads(&network, (own.from, own.to), Some(index));
                prop_assert_eq!(bridges[index], is_bridge, "{:?} of {:?}", own, &edges);
            }
        }
    }

    #[test]
    fn every_edge_of_a_chain_in_both_directions_is_a_bridge() {
        const COUNT: usize = 20_000;
        let there = (1..COUNT).map(|index| (index - 1, index));
        let back = (1..COUNT).map(|index| (index, index - 1));
        let edges: Vec<_> = there.chain(back).collect();
        assert!(
            network(COUNT, &edges)
                .strong_bridges()
                .into_iter()
                .all(|own| own)
        );
    }
}
