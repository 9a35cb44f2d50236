//! Cycles of constraints that parameters lie on.

use std::collections::BTreeMap;

use crate::reduction::Edge;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, ParameterId, Side};
use elbowroom_stn::{Constraint, Network, NodeId as ClassId};

/// The ends through which a parameter can make the network inconsistent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// No value can: the parameter is on no cycle.
    None,
    /// Small values can: the parameter is only an upper bound.
    Lower,
    /// Large values can: the parameter is only a lower bound.
    Upper,
    /// Small and large values can.
    Both,
}

/// Returns limits on the reach of ends of parameters that are differences of times, from bounds on
/// the same differences, and the positions of the remaining edges.
///
/// Let `p` be the difference `d - s`: there is an edge `s -> d` with bound `c + p` and one `d -> s`
/// with `-c - p`. A bound `k` from `d` to `s` closes a cycle of length `c + p + k` with the former,
/// so `p >= -k - c` is required. For such `p`, the latter edge is at least as tight as `k`, which
/// can be left out. The case with `s` and `d` exchanged is analogous. If such bounds were kept, the
/// parameter would lie on cycles in both directions.
pub(crate) fn reach_limits(
    edges: &[Edge],
    coupled: &[ParameterId],
) -> (BTreeMap<BoxEnd, Rational>, Vec<u32>) {
    // For each pair of classes, the end that bounds their difference, and its constant.
    let mut differences: BTreeMap<(ClassId, ClassId), Vec<(BoxEnd, &Rational)>> = BTreeMap::new();
    let own = own_edges(edges.iter());
    for edge in edges {
        if let Some(end) = edge.end
            && coupled.binary_search(&end.parameter).is_err()
            && is_difference(edges, &own[&end.parameter])
        {
            let both_ways = differences.entry((edge.from, edge.to)).or_default();
            both_ways.push((end, &edge.constant));
        }
    }
    let mut limits: BTreeMap<BoxEnd, Rational> = BTreeMap::new();
    let mut left = Vec::new();
    for (index, edge) in (0..).zip(edges) {
        let opposite = differences.get(&(edge.to, edge.from));
        let (None, Some(opposite)) = (edge.end, opposite) else {
            left.push(index);
            continue;
        };
        for (end, constant) in opposite {
            // The path there must not be shorter than the path back, at the end that shortens it.
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

/// Returns the positions of each parameter's edges.
fn own_edges<'a>(edges: impl Iterator<Item = &'a Edge>) -> BTreeMap<ParameterId, Vec<usize>> {
    let mut own: BTreeMap<ParameterId, Vec<usize>> = BTreeMap::new();
    for (index, edge) in edges.enumerate() {
        if let Some(end) = edge.end {
            own.entry(end.parameter).or_default().push(index);
        }
    }
    own
}

/// Returns `true` if a parameter with these edges is the difference of two times: it has exactly
/// one edge in each direction.
fn is_difference(edges: &[Edge], own: &[usize]) -> bool {
    match *own {
        [there, back] => {
            let (there, back) = (&edges[there], &edges[back]);
            (there.from, there.to) == (back.to, back.from)
                && there.from != there.to
                && there.constant == -&back.constant
        }
        _ => false,
    }
}

/// Analysis of the cycles that parameters lie on.
pub(crate) struct Cycles<'a> {
    edges: Vec<&'a Edge>,
    /// For each parameter, the positions of its edges.
    own: BTreeMap<ParameterId, Vec<usize>>,
    /// The strongly connected component of each class.
    component: Vec<usize>,
    /// For each edge, `true` if it is a strong bridge.
    is_bridge: Vec<bool>,
}

impl<'a> Cycles<'a> {
    pub(crate) fn new(edges: Vec<&'a Edge>, class_count: usize) -> Self {
        let mut graph: Network<i128> = Network::with_nodes(class_count);
        for edge in &edges {
            // Only the ends of the edge matter, not its bound.
            graph.add(Constraint::at_most(edge.from, edge.to, 0));
        }
        Self {
            own: own_edges(edges.iter().copied()),
            edges,
            component: graph.components(),
            is_bridge: graph.strong_bridges(),
        }
    }

    /// Returns the role of an uncoupled parameter in cycles. It has an edge `s -> d` ("at most")
    /// and an edge `d -> s` ("at least"), or only one of them. The cycle of both edges is no
    /// constraint.
    pub(crate) fn role(&self, parameter: ParameterId) -> Role {
        let own = self.own.get(&parameter).map_or(&[][..], Vec::as_slice);
        let on_cycle = |side: Side| {
            own.iter().any(|&index| {
                let end = self.edges[index].end;
                end.is_some_and(|end| end.side == side) && self.is_closed(index, own)
            })
        };
        match (on_cycle(Side::Upper), on_cycle(Side::Lower)) {
            (false, false) => Role::None,
            (true, false) => Role::Lower,
            (false, true) => Role::Upper,
            (true, true) => Role::Both,
        }
    }

    /// Returns `true` if edges lead back from the end of this edge to its beginning, without the
    /// parameter's own edges.
    fn is_closed(&self, index: usize, own: &[usize]) -> bool {
        let edge = self.edges[index];
        let (from, to) = (edge.from, edge.to);
        let mut back = own.iter().filter(|&&other| {
            let other = self.edges[other];
            (other.from, other.to) == (to, from)
        });
        from == to
            || self.component[from.index()] == self.component[to.index()]
                && back.all(|&back| !self.is_bridge[back])
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use elbowroom_plan::{NodeId, Origin};

    use super::*;

    /// Returns `true` if edges other than the parameter's own lead from one class to another.
    fn is_reachable(
        edges: &[Edge],
        (from, to): (ClassId, ClassId),
        parameter: ParameterId,
    ) -> bool {
        let (mut seen, mut stack) = (Vec::new(), vec![from]);
        while let Some(class) = stack.pop() {
            if class == to {
                return true;
            }
            if !seen.contains(&class) {
                seen.push(class);
                let is_other = |edge: &&Edge| edge.end.is_none_or(|end| end.parameter != parameter);
                let leaving = edges.iter().filter(|edge| edge.from == class);
                stack.extend(leaving.filter(is_other).map(|edge| edge.to));
            }
        }
        false
    }

    proptest! {
        #[test]
        fn a_parameter_is_on_a_cycle_if_other_edges_lead_back(
            count in 1..7_u32,
            parameters in prop::collection::vec((0..7_u32, 0..7_u32, 1..4_u8), 1..7),
            fixed in prop::collection::vec((0..7_u32, 0..7_u32), 0..9),
        ) {
            let edge = |from: u32, to: u32, end| Edge {
                from: ClassId(from % count),
                to: ClassId(to % count),
                constant: Rational::ZERO,
                end,
                origin: Origin::Beginning,
                node: NodeId::ZERO,
            };
            let mut edges: Vec<Edge> = fixed.into_iter().map(|(a, b)| edge(a, b, None)).collect();
            let known = parameters.len();
            for (index, (a, b, which)) in parameters.into_iter().enumerate() {
                let end = |side| Some(BoxEnd { parameter: ParameterId::from(index), side });
                if which & 1 != 0 {
                    edges.push(edge(a, b, end(Side::Upper)));
                }
                if which & 2 != 0 {
                    edges.push(edge(b, a, end(Side::Lower)));
                }
            }
            let cycles = Cycles::new(edges.iter().collect(), count as usize);
            for parameter in (0..known).map(ParameterId::from) {
                let on = |side: Side| edges.iter().any(|edge| {
                    edge.end == Some(BoxEnd { parameter, side })
                        && is_reachable(&edges, (edge.to, edge.from), parameter)
                });
                let role = match (on(Side::Upper), on(Side::Lower)) {
                    (false, false) => Role::None,
                    (true, false) => Role::Lower,
                    (false, true) => Role::Upper,
                    (true, true) => Role::Both,
                };
                prop_assert_eq!(cycles.role(parameter), role);
            }
        }
    }
}
