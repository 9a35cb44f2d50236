//! Values in a box without a schedule, found without looking at all corners.
//!
//! Whether each value in a box has a schedule is co-NP-complete in general (weak controllability;
//! Morris & Muscettola 1999), so nothing avoids branching altogether. But few parameters need it.
//! Each bound is first taken at its worst, whatever the other bound of its parameter says. If no
//! cycle is negative even so, all values have a schedule. If one is that takes no parameter at two
//! different values, some values have none. Only where a negative cycle takes a parameter at both
//! of its ends, that parameter is set to the one, and then to the other: the values with a schedule
//! form a convex set.

use std::collections::{BTreeMap, VecDeque};

use crate::reduction::Edge;
use elbowroom_num::Rational;
use elbowroom_plan::{ParameterId, Side};

/// How many branches are looked at before the question is given up.
pub(crate) const MOST_BRANCHES: usize = 1 << 14;

/// More branches would be needed than [`MOST_BRANCHES`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooManyBranches;

/// A network whose bounds depend on parameters.
pub(crate) struct Branching<'a> {
    /// The edges that lie on cycles.
    pub(crate) edges: Vec<&'a Edge>,
    pub(crate) class_count: usize,
    /// Parameters that bound one difference only, from above and from below: no simple cycle takes
    /// both bounds.
    pub(crate) is_pair: &'a dyn Fn(ParameterId) -> bool,
    /// The value at an end.
    pub(crate) value: &'a dyn Fn(ParameterId, Side) -> Rational,
}

/// Parameters, and the ends they are set to.
type Sides = BTreeMap<ParameterId, Side>;

impl Branching<'_> {
    /// A corner of the box without a schedule: those parameters that matter, and at which end each
    /// is.
    pub(crate) fn corner_without_schedule(&self) -> Result<Option<Sides>, TooManyBranches> {
        let mut branches: Vec<Sides> = vec![self.points()];
        let mut looked_at = 0;
        while let Some(chosen) = branches.pop() {
            looked_at += 1;
            if looked_at > MOST_BRANCHES {
                return Err(TooManyBranches);
            }
            let weights: Vec<Rational> = self
                .edges
                .iter()
                .map(|edge| self.weight(edge, &chosen))
                .collect();
            let Some(walk) = Walks::new(self, &weights).negative() else {
                continue;
            };
            let mut torn = None;
            for cycle in simple_cycles(&self.edges, &walk) {
                let weight: Rational = cycle.iter().map(|&edge| &weights[edge]).sum();
                if !weight.is_negative() {
                    continue;
                }
                match self.sides(&cycle, &chosen) {
                    Ok(sides) => return Ok(Some(sides)),
                    Err(parameter) => torn = torn.or(Some(parameter)),
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

    /// Parameters of which there is one value only.
    fn points(&self) -> Sides {
        let ends = self.edges.iter().filter_map(|edge| edge.end);
        ends.map(|end| end.parameter)
            .filter(|&id| (self.value)(id, Side::Lower) == (self.value)(id, Side::Upper))
            .map(|id| (id, Side::Lower))
            .collect()
    }

    /// The bound of an edge, at its worst where nothing is chosen.
    fn weight(&self, edge: &Edge, chosen: &Sides) -> Rational {
        let Some(end) = edge.end else {
            return edge.constant.clone();
        };
        let side = chosen.get(&end.parameter).copied();
        let value = (self.value)(end.parameter, side.unwrap_or(end.side.opposite()));
        match end.side {
            Side::Upper => &edge.constant + value,
            Side::Lower => &edge.constant - value,
        }
    }

    /// The ends at which a cycle takes its parameters, beside those chosen before.
    ///
    /// # Errors
    /// A parameter that it takes at both.
    fn sides(&self, cycle: &[usize], chosen: &Sides) -> Result<Sides, ParameterId> {
        let mut sides = chosen.clone();
        for &edge in cycle {
            let Some(end) = self.edges[edge].end else {
                continue;
            };
            if chosen.contains_key(&end.parameter) {
                continue;
            }
            let worst = end.side.opposite();
            if *sides.entry(end.parameter).or_insert(worst) != worst {
                return Err(end.parameter);
            }
        }
        Ok(sides)
    }
}

/// Takes a closed walk apart.
fn simple_cycles(edges: &[&Edge], walk: &[usize]) -> Vec<Vec<usize>> {
    let mut cycles = Vec::new();
    // Where on the path each class has been left.
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

/// A way to a class.
struct Label {
    class: usize,
    length: Rational,
    /// The last edge, and the way before it; `None` at the beginning.
    last: Option<(usize, usize)>,
    depth: usize,
}

/// Shortest walks from anywhere that never go over both bounds of a parameter straight after each
/// other.
struct Walks<'a> {
    network: &'a Branching<'a>,
    weights: &'a [Rational],
    leaving: Vec<Vec<usize>>,
    labels: Vec<Label>,
    /// For each class, the shortest way to it, and, if that one may not go on everywhere, the
    /// shortest with another last parameter.
    best: Vec<[Option<usize>; 2]>,
}

impl<'a> Walks<'a> {
    fn new(network: &'a Branching<'a>, weights: &'a [Rational]) -> Self {
        let mut leaving = vec![Vec::new(); network.class_count];
        for (index, edge) in network.edges.iter().enumerate() {
            leaving[edge.from.index()].push(index);
        }
        let start = |class| Label {
            class,
            length: Rational::ZERO,
            last: None,
            depth: 0,
        };
        Self {
            network,
            weights,
            leaving,
            labels: (0..network.class_count).map(start).collect(),
            best: (0..network.class_count)
                .map(|class| [Some(class), None])
                .collect(),
        }
    }

    /// A closed walk of negative length, as edges.
    fn negative(mut self) -> Option<Vec<usize>> {
        // A way over so many edges is at some class three times. Two labels are kept for a class,
        // so it was shorter the third time than one time before.
        let enough = 2 * self.network.class_count + 2;
        let mut look_at = 8.min(enough);
        let mut waiting: VecDeque<usize> = (0..self.network.class_count).collect();
        while let Some(label) = waiting.pop_front() {
            let class = self.labels[label].class;
            if !self.best[class].contains(&Some(label)) {
                continue;
            }
            for index in 0..self.leaving[class].len() {
                let edge = self.leaving[class][index];
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

    /// The parameter whose other bound may not come next.
    fn pair(&self, edge: usize) -> Option<ParameterId> {
        let edge = self.network.edges[edge];
        let end = edge.end.filter(|_| edge.from != edge.to)?;
        (self.network.is_pair)(end.parameter).then_some(end.parameter)
    }

    /// Whether the edge may follow, and no better label goes over it.
    fn may_take(&self, label: usize, edge: usize) -> bool {
        let Label { class, last, .. } = self.labels[label];
        let own = self.pair(edge);
        let is_blocked = |last: Option<(usize, usize)>| {
            own.is_some() && last.is_some_and(|(last, _)| self.pair(last) == own)
        };
        if is_blocked(last) {
            return false;
        }
        let [first, _] = self.best[class];
        first == Some(label) || first.is_some_and(|first| is_blocked(self.labels[first].last))
    }

    /// Goes over an edge; the new label, if it is worth keeping.
    fn extend(&mut self, label: usize, edge: usize) -> Option<usize> {
        let class = self.network.edges[edge].to.index();
        let length = &self.labels[label].length + &self.weights[edge];
        let pair = self.pair(edge);
        let last_pair = |walks: &Self, label: usize| {
            let last = walks.labels[label].last;
            last.and_then(|(edge, _)| walks.pair(edge))
        };
        let [first, second] = self.best[class];
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
        self.best[class] = kept;
        self.labels.push(Label {
            class,
            length,
            last: Some((edge, label)),
            depth: self.labels[label].depth + 1,
        });
        Some(new)
    }

    /// The part of a way between two times at the same class, if it is shorter at the second.
    fn closed_walk(&self, end: usize) -> Option<Vec<usize>> {
        // From the end backwards: for each class, the shortest label after this point.
        let mut later: BTreeMap<usize, usize> = BTreeMap::new();
        let mut label = end;
        loop {
            let Label { class, last, .. } = self.labels[label];
            match later.get(&class) {
                Some(&after) if self.labels[after].length < self.labels[label].length => {
                    return Some(self.edges_between(label, after));
                }
                _ => later.insert(class, label),
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
