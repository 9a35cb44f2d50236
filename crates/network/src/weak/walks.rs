//! Walks of negative length that never go over a link and straight back.

use std::collections::{BTreeMap, VecDeque};

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::LinkId;

use super::Edge;

/// A network's edges, sorted for walking.
pub(super) struct Walks {
    /// For each node, the edges that begin there and lie on a cycle.
    leaving: Vec<Vec<usize>>,
}

impl Walks {
    pub(super) fn new(edges: &[Edge], node_count: usize) -> Self {
        let component = components(edges, node_count);
        let mut leaving = vec![Vec::new(); node_count];
        for (index, edge) in edges.iter().enumerate() {
            if component[edge.from.index()] == component[edge.to.index()] {
                leaving[edge.from.index()].push(index);
            }
        }
        Self { leaving }
    }

    /// A closed walk of negative length, as edges.
    pub(super) fn negative(&self, edges: &[Edge], weights: &[Rational]) -> Option<Vec<usize>> {
        Search::new(self, edges, weights).run()
    }
}

/// For each node, a number that it shares with those on a cycle with it (Kosaraju's algorithm).
fn components(edges: &[Edge], node_count: usize) -> Vec<usize> {
    let mut there = vec![Vec::new(); node_count];
    let mut back = vec![Vec::new(); node_count];
    for edge in edges {
        there[edge.from.index()].push(edge.to.index());
        back[edge.to.index()].push(edge.from.index());
    }
    let mut order = Vec::with_capacity(node_count);
    let mut is_seen = vec![false; node_count];
    for root in 0..node_count {
        // Nodes, each with the next neighbour to look at.
        let mut path = Vec::new();
        if !std::mem::replace(&mut is_seen[root], true) {
            path.push((root, 0));
        }
        while let Some((node, next)) = path.last_mut() {
            let Some(&to) = there[*node].get(*next) else {
                order.push(*node);
                path.pop();
                continue;
            };
            *next += 1;
            if !std::mem::replace(&mut is_seen[to], true) {
                path.push((to, 0));
            }
        }
    }
    let mut component = vec![usize::MAX; node_count];
    for &root in order.iter().rev() {
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            if component[node] == usize::MAX {
                component[node] = root;
                stack.extend(&back[node]);
            }
        }
    }
    component
}

/// A way to a node.
struct Label {
    node: usize,
    length: Rational,
    /// The last edge, and the way before it; `None` at the beginning.
    last: Option<(usize, usize)>,
    depth: usize,
}

/// Shortest walks from anywhere.
struct Search<'a> {
    walks: &'a Walks,
    edges: &'a [Edge],
    weights: &'a [Rational],
    labels: Vec<Label>,
    /// For each node, the shortest way to it, and, if that one may not go on everywhere, the
    /// shortest with another last link.
    best: Vec<[Option<usize>; 2]>,
}

impl<'a> Search<'a> {
    fn new(walks: &'a Walks, edges: &'a [Edge], weights: &'a [Rational]) -> Self {
        let start = |node| Label {
            node,
            length: Rational::ZERO,
            last: None,
            depth: 0,
        };
        let count = walks.leaving.len();
        Self {
            walks,
            edges,
            weights,
            labels: (0..count).map(start).collect(),
            best: (0..count).map(|node| [Some(node), None]).collect(),
        }
    }

    fn run(mut self) -> Option<Vec<usize>> {
        // A way over so many edges is at some node three times. Two labels are kept for a node, so
        // it was shorter the third time than one time before.
        let enough = 2 * self.walks.leaving.len() + 2;
        let mut look_at = 8.min(enough);
        let mut waiting: VecDeque<usize> = (0..self.labels.len()).collect();
        while let Some(label) = waiting.pop_front() {
            let node = self.labels[label].node;
            if !self.best[node].contains(&Some(label)) {
                continue;
            }
            let walks = self.walks;
            for &edge in &walks.leaving[node] {
                if !self.may_take(label, edge) {
                    continue;
                }
                let Some(next) = self.extend(label, edge) else {
                    continue;
                };
                if self.labels[next].depth >= look_at {
                    if let Some(walk) = self.closed_walk(next) {
                        return Some(walk);
                    }
                    look_at = (2 * look_at).min(enough);
                }
                waiting.push_back(next);
            }
        }
        None
    }

    /// The link whose other bound may not come next.
    fn link(&self, edge: usize) -> Option<LinkId> {
        self.edges[edge].end.map(|(link, _)| link)
    }

    /// Whether the edge may follow, and no better label goes over it.
    fn may_take(&self, label: usize, edge: usize) -> bool {
        let Label { node, last, .. } = self.labels[label];
        let own = self.link(edge);
        let is_blocked = |last: Option<(usize, usize)>| {
            own.is_some() && last.is_some_and(|(last, _)| self.link(last) == own)
        };
        if is_blocked(last) {
            return false;
        }
        let [first, _] = self.best[node];
        first == Some(label) || first.is_some_and(|first| is_blocked(self.labels[first].last))
    }

    /// Goes over an edge; the new label, if it is worth keeping.
    fn extend(&mut self, label: usize, edge: usize) -> Option<usize> {
        let node = self.edges[edge].to.index();
        let length = &self.labels[label].length + &self.weights[edge];
        let link = self.link(edge);
        let last_link = |search: &Self, label: usize| {
            let last = search.labels[label].last;
            last.and_then(|(edge, _)| search.link(edge))
        };
        let [first, second] = self.best[node];
        let first = first?;
        let is_first = length < self.labels[first].length;
        let is_second = || {
            let other = last_link(self, first);
            other.is_some()
                && other != link
                && second.is_none_or(|second| length < self.labels[second].length)
        };
        if !is_first && !is_second() {
            return None;
        }
        let new = self.labels.len();
        let kept = if !is_first {
            [Some(first), Some(new)]
        } else if link.is_none() || last_link(self, first) != link {
            [Some(new), link.map(|_| first)]
        } else {
            [Some(new), second]
        };
        self.best[node] = kept;
        self.labels.push(Label {
            node,
            length,
            last: Some((edge, label)),
            depth: self.labels[label].depth + 1,
        });
        Some(new)
    }

    /// The part of a way between two times at the same node, if it is shorter at the second.
    fn closed_walk(&self, end: usize) -> Option<Vec<usize>> {
        // From the end backwards: for each node, the shortest label after this point.
        let mut later: BTreeMap<usize, usize> = BTreeMap::new();
        let mut label = end;
        loop {
            let Label { node, last, .. } = self.labels[label];
            match later.get(&node) {
                Some(&after) if self.labels[after].length < self.labels[label].length => {
                    return Some(self.edges_between(label, after));
                }
                _ => later.insert(node, label),
            };
            label = last?.1;
        }
    }

    fn edges_between(&self, start: usize, end: usize) -> Vec<usize> {
        let mut edges = Vec::new();
        let mut label = end;
        while label != start
            && let Some((edge, before)) = self.labels[label].last
        {
            edges.push(edge);
            label = before;
        }
        edges.reverse();
        edges
    }
}
