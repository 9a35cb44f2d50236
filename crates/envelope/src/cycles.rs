//! On which cycles of constraints parameters lie.

use std::collections::BTreeMap;

use crate::reduction::Edge;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, ParameterId, Side};
use elbowroom_stn::NodeId as ClassId;

/// Through which of its ends a parameter can make the network inconsistent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// It is on no cycle.
    None,
    /// Small values break things: it is only used as an upper bound.
    Lower,
    /// Large values break things: it is only used as a lower bound.
    Upper,
    /// Both can.
    Both,
}

/// How far out the ends of parameters may lie that are differences of times, by bounds on these
/// same differences; and the edges that are left then.
///
/// Let `p` be the difference `d - s`: there is an edge `s -> d` with bound `c + p` and one `d -> s`
/// with `-c - p`. A bound `k` from `d` to `s` closes a cycle of length `c + p + k` with the former,
/// so `p >= -k - c` is needed; but for such `p` the latter is at least as tight as `k`, which can
/// be left out. Likewise with `s` and `d` changed. Left in, such bounds would put the parameter on
/// cycles both ways.
pub(crate) fn own_limits(
    edges: &[Edge],
    coupled: &[ParameterId],
) -> (BTreeMap<BoxEnd, Rational>, Vec<Edge>) {
    // For each pair of classes, the end that bounds their difference, and its constant.
    let mut differences: BTreeMap<(ClassId, ClassId), Vec<(BoxEnd, &Rational)>> = BTreeMap::new();
    for edge in edges {
        if let Some(end) = edge.end
            && !coupled.contains(&end.parameter)
            && is_difference(edges, end.parameter)
        {
            let both_ways = differences.entry((edge.from, edge.to)).or_default();
            both_ways.push((end, &edge.constant));
        }
    }
    let mut limits: BTreeMap<BoxEnd, Rational> = BTreeMap::new();
    let mut left = Vec::new();
    for edge in edges {
        let opposite = differences.get(&(edge.to, edge.from));
        let (None, Some(opposite)) = (edge.end, opposite) else {
            left.push(edge.clone());
            continue;
        };
        for (end, constant) in opposite {
            // The way there must not be shorter than the way back, at the end that shortens it.
            let inner = BoxEnd {
                side: end.side.opposite(),
                ..*end
            };
            let limit = *constant + &edge.constant;
            let known = limits.entry(inner).or_insert_with(|| limit.clone());
            if limit < *known {
                *known = limit;
            }
        }
    }
    (limits, left)
}

/// Whether a parameter is the difference of two times: an edge there and one back, and no more.
fn is_difference(edges: &[Edge], parameter: ParameterId) -> bool {
    let own = edges
        .iter()
        .filter(|edge| edge.end.is_some_and(|end| end.parameter == parameter));
    match own.collect::<Vec<_>>()[..] {
        [there, back] => {
            (there.from, there.to) == (back.to, back.from)
                && there.from != there.to
                && there.constant == -&back.constant
        }
        _ => false,
    }
}

/// Looks for the cycles that parameters are on.
pub(crate) struct Cycles<'a> {
    edges: &'a [Edge],
    /// For each class, the edges that leave it: positions in `leaving`.
    ranges: Vec<std::ops::Range<usize>>,
    /// Positions in `edges`.
    leaving: Vec<usize>,
    /// For each parameter, its edges.
    own: BTreeMap<ParameterId, Vec<usize>>,
    /// For each class, the last search that saw it.
    seen: Vec<usize>,
    searches: usize,
    stack: Vec<usize>,
}

impl<'a> Cycles<'a> {
    pub(crate) fn new(edges: &'a [Edge], class_count: usize) -> Self {
        let mut leaving: Vec<usize> = (0..edges.len()).collect();
        leaving.sort_by_key(|&index| edges[index].from);
        let first_from =
            |class: usize| leaving.partition_point(|&index| edges[index].from.index() < class);
        let ranges = (0..class_count).map(|class| first_from(class)..first_from(class + 1));
        let ranges = ranges.collect();
        let mut own: BTreeMap<ParameterId, Vec<usize>> = BTreeMap::new();
        for (index, edge) in edges.iter().enumerate() {
            if let Some(end) = edge.end {
                own.entry(end.parameter).or_default().push(index);
            }
        }
        Self {
            edges,
            ranges,
            leaving,
            own,
            seen: vec![0; class_count],
            searches: 0,
            stack: Vec::new(),
        }
    }

    /// How an uncoupled parameter lies on cycles. Its edges are one `s -> d` ("at most") and one
    /// `d -> s` ("at least"), or only one of them; going there and back along both says nothing.
    pub(crate) fn role(&mut self, parameter: ParameterId) -> Role {
        let own = self.own.remove(&parameter).unwrap_or_default();
        let mut on_cycle = |side: Side| {
            own.iter().any(|&index| {
                let edge = &self.edges[index];
                edge.end.is_some_and(|end| end.side == side)
                    && self.reaches(edge.to.index(), edge.from.index(), parameter)
            })
        };
        match (on_cycle(Side::Upper), on_cycle(Side::Lower)) {
            (false, false) => Role::None,
            (true, false) => Role::Lower,
            (false, true) => Role::Upper,
            (true, true) => Role::Both,
        }
    }

    /// Whether edges lead from one class to another that are not the parameter's own.
    fn reaches(&mut self, from: usize, to: usize, parameter: ParameterId) -> bool {
        self.searches += 1;
        self.stack.clear();
        self.stack.push(from);
        self.seen[from] = self.searches;
        while let Some(class) = self.stack.pop() {
            if class == to {
                return true;
            }
            for &index in &self.leaving[self.ranges[class].clone()] {
                let edge = &self.edges[index];
                let far = edge.to.index();
                if self.seen[far] != self.searches
                    && edge.end.is_none_or(|end| end.parameter != parameter)
                {
                    self.seen[far] = self.searches;
                    self.stack.push(far);
                }
            }
        }
        false
    }
}
