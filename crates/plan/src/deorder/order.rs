//! Orders of interfering happenings, fact by fact and fluent by fluent.
//!
//! The access of a happening to one fact or fluent is its *use*. Uses of the same kind commute,
//! except assignments; all others interfere. So the uses of one fact, in order of time, form runs
//! of commuting uses. It is sufficient to order each run after the previous one. This needs about
//! as many constraints as uses, whereas pairs would need a quadratic number.

use std::collections::BTreeMap;

use elbowroom_model::Footprint;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;

use crate::network::Schedule;
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};

/// Constraints `to - from >= distance`, the strongest one for each pair.
#[derive(Debug, Default)]
pub(super) struct Order {
    distances: BTreeMap<(NodeId, NodeId), (Rational, Reason)>,
}

impl Order {
    /// Adds the constraint that `to` comes at least `distance` after `from`.
    pub(super) fn require_distance(
        &mut self,
        from: NodeId,
        to: NodeId,
        distance: Rational,
        reason: Reason,
    ) {
        if from == to {
            return;
        }
        let known = self.distances.get(&(from, to));
        if known.is_none_or(|(known, _)| *known < distance) {
            self.distances.insert((from, to), (distance, reason));
        }
    }

    /// Returns the constraints, sorted by nodes.
    pub(super) fn into_constraints(self) -> impl Iterator<Item = Constraint> {
        self.distances
            .into_iter()
            .map(|((from, to), (distance, reason))| Constraint {
                from,
                to,
                lower: Bound::Finite(distance),
                upper: Bound::Infinite,
                reason,
            })
    }
}

/// A fact or a fluent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Quantity {
    Fact(FactId),
    Fluent(FluentId),
}

/// Uses of a quantity by a happening, as a bit set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Use(u8);

impl Use {
    const READ: u8 = 1;
    /// Makes a fact true, increases or decreases a fluent.
    const ADD: u8 = 2;
    /// Makes a fact false.
    const DELETE: u8 = 4;
    /// Changes a fluent in any other way.
    const ASSIGN: u8 = 8;

    fn writes(self) -> bool {
        self.0 != Self::READ
    }

    /// Returns `true` if two uses may be simultaneous in either order.
    fn commutes_with(self, other: Self) -> bool {
        self == other && matches!(self.0, Self::READ | Self::ADD | Self::DELETE)
    }
}

/// Uses of each quantity in order of time.
pub(super) struct Timeline<'a> {
    times: &'a Schedule,
    uses: BTreeMap<Quantity, Vec<(NodeId, Use)>>,
}

impl<'a> Timeline<'a> {
    /// Creates a timeline; `times` and `footprints` are by node.
    pub(super) fn new(times: &'a Schedule, footprints: &[Footprint]) -> Self {
        let mut nodes: Vec<NodeId> = (0..times.len()).map(NodeId::from).collect();
        nodes.sort_by(|a, b| times[*a].cmp(&times[*b]));
        let mut uses: BTreeMap<Quantity, Vec<(NodeId, Use)>> = BTreeMap::new();
        for node in nodes {
            for (quantity, bits) in uses_of(&footprints[node.index()]) {
                uses.entry(quantity).or_default().push((node, Use(bits)));
            }
        }
        Self { times, uses }
    }

    /// Returns the time of a node.
    pub(super) fn time(&self, node: NodeId) -> &Rational {
        &self.times[node]
    }

    /// Adds constraints that keep the order of interfering happenings.
    ///
    /// Returns two of them as an error if they are simultaneous.
    pub(super) fn interference(
        &self,
        plan: &StnPlan,
        epsilon: &Rational,
        order: &mut Order,
    ) -> Result<(), (NodeId, NodeId)> {
        let is_fixed = |node: NodeId| matches!(plan.nodes[node.index()], Node::Timed(_));
        for uses in self.uses.values() {
            let runs = runs(uses);
            for (first, second) in runs.iter().zip(runs.iter().skip(1)) {
                for &from in first {
                    for &to in second {
                        if self.time(from) == self.time(to) {
                            return Err((from, to));
                        }
                        if !(is_fixed(from) && is_fixed(to)) {
                            order.require_distance(from, to, epsilon.clone(), Reason::Interference);
                        }
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the writers of a quantity in order of time.
    pub(super) fn writers(&self, quantity: Quantity) -> Vec<Writer> {
        let uses = self.uses.get(&quantity).into_iter().flatten();
        let writers: Vec<_> = uses.copied().filter(|(_, what)| what.writes()).collect();
        let chunks = writers.chunk_by(|(_, a), (_, b)| a.commutes_with(*b));
        let in_run = |(run, uses): (usize, &'_ [(NodeId, Use)])| {
            let writer = |&(node, what): &(NodeId, Use)| Writer {
                node,
                run,
                access: what,
            };
            uses.iter().map(writer).collect::<Vec<_>>()
        };
        chunks.enumerate().flat_map(in_run).collect()
    }
}

/// A happening that changes a quantity, and the number of its run of commuting uses.
pub(super) struct Writer {
    pub(super) node: NodeId,
    pub(super) run: usize,
    access: Use,
}

impl Writer {
    /// Returns `true` if the fact is true after it. An addition wins over a deletion.
    pub(super) fn makes_true(&self) -> bool {
        self.access.0 & Use::ADD != 0
    }

    /// Returns `true` if it only increases and decreases the fluent.
    pub(super) fn is_shift(&self) -> bool {
        self.access.0 == Use::ADD
    }
}

/// Splits a sequence of uses where neighbours do not commute.
fn runs(uses: &[(NodeId, Use)]) -> Vec<Vec<NodeId>> {
    uses.chunk_by(|(_, a), (_, b)| a.commutes_with(*b))
        .map(|run| run.iter().map(|&(node, _)| node).collect())
        .collect()
}

/// Returns the uses of each quantity in a footprint.
fn uses_of(footprint: &Footprint) -> BTreeMap<Quantity, u8> {
    let mut uses = BTreeMap::new();
    let mut note = |quantity: Quantity, bit: u8| *uses.entry(quantity).or_default() |= bit;
    for (facts, bit) in [
        (&footprint.reads, Use::READ),
        (&footprint.adds, Use::ADD),
        (&footprint.deletes, Use::DELETE),
    ] {
        for &fact in facts {
            note(Quantity::Fact(fact), bit);
        }
    }
    for (fluents, bit) in [
        (&footprint.reads_fluents, Use::READ),
        (&footprint.shifts, Use::ADD),
        (&footprint.assigns, Use::ASSIGN),
    ] {
        for &fluent in fluents {
            note(Quantity::Fluent(fluent), bit);
        }
    }
    uses
}

/// Returns the quantities that the footprint reads.
pub(super) fn read_by(footprint: &Footprint) -> impl Iterator<Item = Quantity> + '_ {
    let facts = footprint.reads.iter().map(|&fact| Quantity::Fact(fact));
    let fluents = footprint.reads_fluents.iter();
    facts.chain(fluents.map(|&fluent| Quantity::Fluent(fluent)))
}
