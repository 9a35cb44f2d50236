//! Values of the nodes of a graph, and the open nodes that matter most.

use std::collections::VecDeque;

use super::{Branch, CHOICE, Graph, Node, number};

/// Change of a value below which it counts as settled.
const SETTLED: f64 = 1e-12;

/// Limit on the evaluated edges of one computation of all values.
const MAX_EDGES: usize = 40_000_000;

/// Values by node.
pub(super) struct Values {
    pub(super) values: Vec<f64>,
    /// `false` if the limit on work was reached. The values are lower bounds in this case.
    pub(super) has_converged: bool,
}

impl Graph<'_> {
    /// Computes the values of all nodes from below. Open nodes count as reached goals
    /// if `is_optimistic`, and as lost otherwise.
    pub(super) fn values(&self, is_optimistic: bool) -> Values {
        let is_solvable = self.solvable(is_optimistic);
        let initial = |node: &Node| match node {
            Node::Goal => 1.0,
            Node::Open => f64::from(u8::from(is_optimistic)),
            Node::Expanded(..) => 0.0,
        };
        let mut values: Vec<f64> = self.nodes.iter().map(initial).collect();
        let mut work = 0;
        loop {
            let mut greatest: f64 = 0.0;
            // Most nodes are discovered after those that lead to them.
            for node in (0..self.len()).rev().filter(|node| is_solvable[*node]) {
                if let Some((_, value)) = self.best_branch(node, &values) {
                    greatest = greatest.max(value - values[node]);
                    values[node] = value.max(values[node]);
                }
            }
            work += self.edges.len();
            if greatest < SETTLED || work > MAX_EDGES {
                return Values {
                    values,
                    has_converged: greatest < SETTLED,
                };
            }
        }
    }

    fn branches_of(&self, node: usize) -> &[Branch] {
        match self.nodes[node] {
            Node::Expanded(first, end) => &self.branches[first as usize..end as usize],
            Node::Open | Node::Goal => &[],
        }
    }

    fn edges_of(&self, branch: &Branch) -> &[(u32, f64)] {
        &self.edges[branch.edges.0 as usize..branch.edges.1 as usize]
    }

    /// Returns the best branch of a node and its value.
    fn best_branch(&self, node: usize, values: &[f64]) -> Option<(&Branch, f64)> {
        let branches = self.branches_of(node).iter();
        let rated = branches.map(|branch| (branch, self.value_of(node, branch, values)));
        rated.reduce(|best, other| if other.1 > best.1 { other } else { best })
    }

    /// Returns the value of a branch that is taken again whenever it leads back to its node.
    fn value_of(&self, node: usize, branch: &Branch, values: &[f64]) -> f64 {
        let (mut sum, mut leaving, mut staying) = (0.0, 0.0, 0.0);
        for &(target, weight) in self.edges_of(branch) {
            if target as usize == node {
                staying += weight;
            } else {
                sum += weight * values[target as usize];
                leaving += weight;
            }
        }
        if staying > 0.0 && leaving > 0.0 {
            sum / leaving
        } else {
            sum
        }
    }

    /// Returns `true` for each node that is not a dead end: the goal is reachable from it
    /// without failures. The random draws of a step are not dead ends either.
    fn solvable(&self, is_optimistic: bool) -> Vec<bool> {
        let initial = |(node, key): (&Node, &super::Key)| match node {
            Node::Goal => true,
            Node::Open => is_optimistic,
            Node::Expanded(..) => key.stage != CHOICE,
        };
        let nodes = self.nodes.iter().zip(&self.keys);
        let mut solvable: Vec<bool> = nodes.map(initial).collect();
        loop {
            let mut is_changed = false;
            for node in (0..self.len()).rev() {
                let mut next = self.branches_of(node).iter().map(|it| it.nominal as usize);
                if !solvable[node] && next.any(|next| solvable[next]) {
                    solvable[node] = true;
                    is_changed = true;
                }
            }
            if !is_changed {
                return solvable;
            }
        }
    }

    /// Returns the open nodes that an agent reaches if it takes the best branches for `values`,
    /// the likeliest first.
    pub(super) fn likely_open_nodes(&self, roots: &[(u32, f64)], values: &[f64]) -> Vec<u32> {
        let mut likelihood = vec![0.0_f64; self.len()];
        let mut queue = VecDeque::new();
        for &(root, weight) in roots {
            likelihood[root as usize] = weight;
            queue.push_back(root as usize);
        }
        let mut open = Vec::new();
        while let Some(node) = queue.pop_front() {
            if self.nodes[node] == Node::Open {
                open.push(node);
            }
            let best = self.best_branch(node, values);
            for &(target, weight) in best.map_or(&[][..], |(branch, _)| self.edges_of(branch)) {
                let target = target as usize;
                let is_new = likelihood[target] == 0.0;
                likelihood[target] += likelihood[node] * weight;
                if is_new && likelihood[target] > 0.0 {
                    queue.push_back(target);
                }
            }
        }
        open.sort_by(|one, other| likelihood[*other].total_cmp(&likelihood[*one]));
        open.into_iter().map(number).collect()
    }
}
