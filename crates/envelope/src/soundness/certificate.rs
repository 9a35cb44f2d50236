//! Proofs that a bad case is impossible, and their dependence on a box.

use elbowroom_num::{Accumulator, Delta, Rational};

use crate::reduction::Edge;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

/// Sum of constraints with a value below zero on one side and zero on the other.
///
/// By Farkas' lemma a system of linear inequalities is infeasible exactly if such a sum exists. Its
/// value in a box is `base + Σ factor · reach(end)`. If it is below zero, the bad case is
/// impossible in that box. So after a box has been widened, one sum decides whether an old proof
/// still holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Certificate {
    base: Delta,
    /// Positive factors. Once it is [complete](Self::complete), sorted by end.
    ends: Vec<(BoxEnd, Rational)>,
    /// Ends that the factors themselves depend on: once one moves, the proof is void.
    pub(crate) fixed: Vec<BoxEnd>,
    /// Constraints of the sum with their factors; empty unless the proof is to be exported.
    pub(crate) terms: Vec<(Term, Rational)>,
}

/// A constraint in a [`Certificate`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Term {
    /// The edge of the reduced network at this position.
    Edge(usize),
    /// The assumption at this position.
    Assumed(usize),
    /// The inequality of the case at this position.
    Inequality(usize),
}

impl Certificate {
    /// Adds `factor` times a constant.
    pub(crate) fn add_constant(&mut self, constant: &Delta, factor: &Rational) {
        self.base = &self.base + &constant.scaled(factor);
    }

    /// Adds `factor` times an edge's bound.
    pub(crate) fn add_edge(&mut self, edge: &Edge, factor: &Rational) {
        self.base.real += &edge.constant * factor;
        if let Some(end) = edge.end {
            self.add_end(end, factor);
        }
    }

    /// Adds `factor` times an end's reach.
    pub(crate) fn add_end(&mut self, end: BoxEnd, factor: &Rational) {
        self.ends.push((end, factor.clone()));
    }

    /// Completes the certificate after all additions.
    #[must_use]
    pub(crate) fn complete(mut self) -> Self {
        self.ends.sort_by_key(|(end, _)| *end);
        self.ends.dedup_by(|(end, factor), (before, sum)| {
            let is_same = end == before;
            if is_same {
                *sum += &*factor;
            }
            is_same
        });
        self.ends.shrink_to_fit();
        self
    }

    /// Returns the ends of the sum, with their factors.
    pub(crate) fn ends(&self) -> &[(BoxEnd, Rational)] {
        &self.ends
    }

    /// Returns `true` if the proof uses the end.
    pub(crate) fn depends_on(&self, end: BoxEnd) -> bool {
        let known = self.ends.binary_search_by_key(&end, |(own, _)| *own);
        known.is_ok() || self.fixed.contains(&end)
    }

    /// Returns the value in the box; `None` for infinity.
    pub(crate) fn value(&self, envelope: &DecoupledEnvelope) -> Option<Delta> {
        let mut real = Accumulator::default();
        real.add(&self.base.real);
        for (end, factor) in &self.ends {
            real.add_product(&end.reach(envelope)?, factor);
        }
        Some(Delta {
            real: real.value(),
            infinitesimal: self.base.infinitesimal.clone(),
        })
    }

    /// Returns `true` if the proof holds in the box, which differs from the proof's box only in
    /// `moved`. `None` means that the difference is unknown.
    pub(crate) fn holds_in(&self, envelope: &DecoupledEnvelope, moved: Option<BoxEnd>) -> bool {
        let is_void = match moved {
            Some(end) => self.fixed.contains(&end),
            None => !self.fixed.is_empty(),
        };
        if is_void {
            return false;
        }
        self.value(envelope)
            .is_some_and(|value| value < Delta::ZERO)
    }
}
