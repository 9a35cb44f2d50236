//! On which cycles of constraints parameters lie.

use std::collections::BTreeMap;

use elbowroom_plan::ParameterId;
use elbowroom_plan::reduction::{Edge, Side};

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
