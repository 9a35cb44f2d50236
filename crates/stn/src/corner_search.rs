//! Values in a box without a schedule, found without enumerating all corners.
//!
//! Bounds of the network depend on quantities, each in an interval: the durations of contingent
//! links, or the parameters of a plan. Whether there is a schedule for all their values is
//! co-NP-complete in general (weak controllability; Vidal & Fargier 1999, Morris & Muscettola
//! 1999), so branching cannot be avoided altogether. But few quantities need it. Each bound is
//! first taken at its worst, independently of the other bound of its quantity. If there is no
//! negative cycle, all values have a schedule. If a negative cycle uses no quantity at two
//! different values, some values have none. Only if a negative cycle uses a quantity at both of its
//! ends, the quantity is set to one end, and then to the other: that is enough because the values
//! with a schedule form a convex set.

use std::collections::{BTreeMap, VecDeque};

use elbowroom_num::{Rational, Side};

use crate::NodeId;

/// The limit on branches was exceeded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooManyBranches;

/// `to - from <= constant + q` for the upper end of a quantity `q` ([`Side::Upper`]), `constant -
/// q` for the lower end ([`Side::Lower`]): the quantity bounds the difference from above, or from
/// below.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OpenBound<Q> {
    /// The time point that is subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// The part of the bound that does not depend on the quantity.
    pub constant: Rational,
    /// The quantity, and the side on which it bounds.
    pub quantity: Option<(Q, Side)>,
}

/// Network whose bounds depend on quantities.
pub struct Branching<'a, Q> {
    /// The bounds that lie on cycles; others are allowed, but take time.
    pub bounds: Vec<OpenBound<Q>>,
    /// The number of time points.
    pub node_count: usize,
    /// Returns `true` if a quantity bounds only one difference, from above and from below. No
    /// simple cycle contains both bounds.
    pub is_pair: &'a dyn Fn(Q) -> bool,
    /// The least and the greatest value of a quantity.
    pub value: &'a dyn Fn(Q, Side) -> Rational,
    /// The limit on branches.
    pub most_branches: usize,
}

/// Quantities, and the ends they are set to.
pub type Corner<Q> = BTreeMap<Q, Side>;

impl<Q: Copy + Ord> Branching<'_, Q> {
    /// Returns a corner of the box without a schedule: the relevant quantities, with the end of
    /// each. `None` if all values have a schedule.
    ///
    /// # Errors
    /// If the limit on branches is exceeded.
    pub fn corner_without_schedule(&self) -> Result<Option<Corner<Q>>, TooManyBranches> {
        let mut branches: Vec<Corner<Q>> = vec![self.points()];
        let mut looked_at = 0;
        while let Some(chosen) = branches.pop() {
            looked_at += 1;
            if looked_at > self.most_branches {
                return Err(TooManyBranches);
            }
            let weights: Vec<Rational> = self
                .bounds
                .iter()
                .map(|bound| self.weight(bound, &chosen))
                .collect();
            let Some(walk) = Walks::new(self, &weights).negative() else {
                continue;
            };
            let mut torn = None;
            for cycle in simple_cycles(&self.bounds, &walk) {
                let weight: Rational = cycle.iter().map(|&edge| &weights[edge]).sum();
                if !weight.is_negative() {
                    continue;
                }
                match self.sides(&cycle, &chosen) {
                    Ok(sides) => return Ok(Some(sides)),
                    Err(quantity) => torn = torn.or(Some(quantity)),
                }
            }
            let torn = torn.expect("a negative walk has a negative cycle");
            for side in [Side::Upper, Side::Lower] {
                let mut branch = chosen.clone();
                branch.insert(torn, side);
                branches.push(branch);
            }
        }
        Ok(None)
    }

    /// Returns the quantities with only one value.
    fn points(&self) -> Corner<Q> {
        let quantities = self.bounds.iter().filter_map(|bound| bound.quantity);
        quantities
            .filter(|&(id, _)| (self.value)(id, Side::Lower) == (self.value)(id, Side::Upper))
            .map(|(id, _)| (id, Side::Lower))
            .collect()
    }

    /// Returns the weight of a bound, at its worst unless its quantity is chosen.
    fn weight(&self, bound: &OpenBound<Q>, chosen: &Corner<Q>) -> Rational {
        let Some((quantity, own)) = bound.quantity else {
            return bound.constant.clone();
        };
        let side = chosen.get(&quantity).copied();
        let value = (self.value)(quantity, side.unwrap_or(own.opposite()));
        match own {
            Side::Upper => &bound.constant + value,
            Side::Lower => &bound.constant - value,
        }
    }

    /// Returns the ends that a cycle uses of its quantities, in addition to those chosen before.
    ///
    /// # Errors
    /// A quantity that the cycle uses at both ends.
    fn sides(&self, cycle: &[usize], chosen: &Corner<Q>) -> Result<Corner<Q>, Q> {
        let mut sides = chosen.clone();
        for &edge in cycle {
            let Some((quantity, own)) = self.bounds[edge].quantity else {
                continue;
            };
            if chosen.contains_key(&quantity) {
                continue;
            }
            let worst = own.opposite();
            if *sides.entry(quantity).or_insert(worst) != worst {
                return Err(quantity);
            }
        }
        Ok(sides)
    }
}

/// Splits a closed walk into simple cycles.
fn simple_cycles<Q>(edges: &[OpenBound<Q>], walk: &[usize]) -> Vec<Vec<usize>> {
    let mut cycles = Vec::new();
    // Position on the path at which each time point was left.
    let mut path: Vec<usize> = Vec::new();
    let mut at: BTreeMap<usize, usize> = BTreeMap::new();
    for &edge in walk {
        at.insert(edges[edge].from.index(), path.len());
        path.push(edge);
        if let Some(&start) = at.get(&edges[edge].to.index()) {
            let cycle = path.split_off(start);
            for &edge in &cycle {
                at.remove(&edges[edge].from.index());
            }
            cycles.push(cycle);
        }
    }
    cycles
}

/// Walk to a node.
struct Label {
    node: usize,
    length: Rational,
    /// The last edge, and the label before it; `None` at the beginning.
    last: Option<(usize, usize)>,
    depth: usize,
}

/// Shortest walks from any node that never use both bounds of a quantity directly after each other.
struct Walks<'a, Q> {
    network: &'a Branching<'a, Q>,
    weights: &'a [Rational],
    leaving: Vec<Vec<usize>>,
    labels: Vec<Label>,
    /// For each node, the shortest walk to it. If that walk excludes some continuation, also the
    /// shortest walk with another last quantity.
    best: Vec<[Option<usize>; 2]>,
}

impl<'a, Q: Copy + Ord> Walks<'a, Q> {
    fn new(network: &'a Branching<'a, Q>, weights: &'a [Rational]) -> Self {
        let mut leaving = vec![Vec::new(); network.node_count];
        for (index, edge) in network.bounds.iter().enumerate() {
            leaving[edge.from.index()].push(index);
        }
        let start = |node| Label {
            node,
            length: Rational::ZERO,
            last: None,
            depth: 0,
        };
        Self {
            network,
            weights,
            leaving,
            labels: (0..network.node_count).map(start).collect(),
            best: (0..network.node_count)
                .map(|node| [Some(node), None])
                .collect(),
        }
    }

    /// Returns a closed walk of negative length, as edges.
    fn negative(mut self) -> Option<Vec<usize>> {
        // A walk with `enough` edges visits some node three times. At most two labels are kept for
        // a node, so the walk was shorter at the third visit than at an earlier one.
        let enough = 2 * self.network.node_count + 2;
        let mut look_at = 8.min(enough);
        let mut waiting: VecDeque<usize> = (0..self.network.node_count).collect();
        while let Some(label) = waiting.pop_front() {
            let node = self.labels[label].node;
            if !self.best[node].contains(&Some(label)) {
                continue;
            }
            for index in 0..self.leaving[node].len() {
                let edge = self.leaving[node][index];
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

    /// Returns the quantity whose other bound must not come next.
    fn pair(&self, edge: usize) -> Option<Q> {
        let edge = &self.network.bounds[edge];
        let (quantity, _) = edge.quantity.filter(|_| edge.from != edge.to)?;
        (self.network.is_pair)(quantity).then_some(quantity)
    }

    /// Returns `true` if the edge may follow this label, and no better label extends along the
    /// edge.
    fn may_take(&self, label: usize, edge: usize) -> bool {
        let Label { node, last, .. } = self.labels[label];
        let own = self.pair(edge);
        let is_blocked = |last: Option<(usize, usize)>| {
            own.is_some() && last.is_some_and(|(last, _)| self.pair(last) == own)
        };
        if is_blocked(last) {
            return false;
        }
        let [first, _] = self.best[node];
        first == Some(label) || first.is_some_and(|first| is_blocked(self.labels[first].last))
    }

    /// Extends a walk by an edge. Returns the new label, if it is worth keeping.
    fn extend(&mut self, label: usize, edge: usize) -> Option<usize> {
        let node = self.network.bounds[edge].to.index();
        let length = &self.labels[label].length + &self.weights[edge];
        let pair = self.pair(edge);
        let last_pair = |walks: &Self, label: usize| {
            let last = walks.labels[label].last;
            last.and_then(|(edge, _)| walks.pair(edge))
        };
        let [first, second] = self.best[node];
        let first = first?;
        let is_first = length < self.labels[first].length;
        let is_second = || {
            let other = last_pair(self, first);
            other.is_some()
                && other != pair
                && second.is_none_or(|second| length < self.labels[second].length)
        };
        if !is_first && !is_second() {
            return None;
        }
        let new = self.labels.len();
        let kept = if !is_first {
            [Some(first), Some(new)]
        } else if pair.is_none() || last_pair(self, first) != pair {
            [Some(new), pair.map(|_| first)]
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

    /// Returns the part of a walk between two visits of the same node, if the walk is shorter at
    /// the second.
    fn closed_walk(&self, end: usize) -> Option<Vec<usize>> {
        // Walks backwards from the end: for each node, the shortest label after this point.
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

#[cfg(test)]
mod tests;
