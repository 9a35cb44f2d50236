//! Linear inequalities on all boxes, learnt from a rejected box: [`Cut`].

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, Origin, Side};

use crate::row::Row;
use crate::soundness::Broken;

/// Rows, at least one of which holds in every box inside the envelope, and none in the rejected
/// box.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The alternatives; usually one.
    pub rows: Vec<Row>,
    /// Proof that every box inside the envelope satisfies one of them.
    pub ground: Ground,
}

/// Proof that one of the rows of a [`Cut`] holds in every box inside the envelope.
#[derive(Clone, Debug, PartialEq)]
pub enum Ground {
    /// The bounds of these constraints form a cycle with a negative sum for some values in a box
    /// that violates the row, so these values have no schedule.
    Cycle(Vec<Origin>),
    /// Like `Cycle`, for bounds that a fixed schedule has to satisfy for the worst values: each
    /// constraint with the constraints of the durations that end early or late before it.
    Fixed(Vec<ProofPart>),
    /// A semi-reducible cycle: the proof that no strategy exists in a box that violates all rows.
    Semireducible(Vec<ProofPath>),
    /// A condition that some schedule violates for some values in a box that violates the row.
    Condition(Broken),
    /// A box that violates all rows includes this one, which the oracle rejects.
    Box(DecoupledEnvelope),
}

/// Sequence of parts: [`elbowroom_stn::uncertain::RefutationPath`], in terms of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProofPath {
    /// The parts; each begins where the previous one ends.
    pub parts: Vec<ProofPart>,
    /// The constraint (by position in the plan) with the duration whose negated lower end is a
    /// lower bound on the length of the path.
    pub unlabelled: Option<usize>,
}

/// One part of a path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProofPart {
    /// A bound that has to be satisfied.
    Bound(Origin),
    /// The duration that this constraint leaves open, at its lower end.
    Early(usize),
    /// The same duration at its upper end, in the backward direction.
    Late(usize),
    /// A path that counts as one bound.
    Path(ProofPath),
}

impl Cut {
    /// Returns `true` if one of the rows holds in a box.
    pub fn holds_in(&self, envelope: &DecoupledEnvelope) -> bool {
        self.rows.iter().any(|row| row.holds_in(envelope))
    }
}

/// `constant + Σ factor · end`, where an end is the number itself: the length of a cycle of bounds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct EndSum {
    pub(crate) constant: Rational,
    factors: BTreeMap<BoxEnd, Rational>,
}

/// Length of one step of a cycle.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Length {
    /// The same length in every box.
    Fixed(Rational),
    /// A factor times an end.
    End(BoxEnd, Rational),
}

impl Length {
    /// Returns the length in a box; `None` if it is infinite.
    pub(crate) fn value(&self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        match self {
            Self::Fixed(length) => Some(length.clone()),
            Self::End(end, factor) => {
                let interval = envelope.interval(end.parameter);
                Some(factor * end.side.of(interval).value()?)
            }
        }
    }
}

impl From<Length> for EndSum {
    fn from(length: Length) -> Self {
        let mut ends = Self::default();
        ends.add_length(&length);
        ends
    }
}

impl EndSum {
    pub(crate) fn constant(constant: Rational) -> Self {
        Self {
            constant,
            factors: BTreeMap::new(),
        }
    }

    pub(crate) fn add_end(&mut self, end: BoxEnd, factor: &Rational) {
        let sum = self.factors.entry(end).or_default();
        *sum += factor;
        if sum.is_zero() {
            self.factors.remove(&end);
        }
    }

    pub(crate) fn add_length(&mut self, length: &Length) {
        match length {
            Length::Fixed(length) => self.constant += length,
            Length::End(end, factor) => self.add_end(*end, factor),
        }
    }

    pub(crate) fn add(&mut self, other: &Self) {
        self.constant += &other.constant;
        for (end, factor) in &other.factors {
            self.add_end(*end, factor);
        }
    }

    pub(crate) fn plus(&self, other: &Self) -> Self {
        let mut sum = self.clone();
        sum.add(other);
        sum
    }

    pub(crate) fn negated(&self) -> Self {
        let factors = self.factors.iter().map(|(end, factor)| (*end, -factor));
        Self {
            constant: -&self.constant,
            factors: factors.collect(),
        }
    }

    /// Returns the sum in a box; `None` if it contains an infinite end.
    pub(crate) fn value(&self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        let mut sum = self.constant.clone();
        for (end, factor) in &self.factors {
            let interval = envelope.interval(end.parameter);
            sum += factor * end.side.of(interval).value()?;
        }
        Some(sum)
    }

    /// Returns `true` if a parameter occurs with both of its ends.
    pub(crate) fn uses_both_ends(&self) -> bool {
        let ends: Vec<&BoxEnd> = self.factors.keys().collect();
        ends.windows(2)
            .any(|pair| pair[0].parameter == pair[1].parameter)
    }

    /// Returns the row that it is not negative.
    pub(crate) fn not_negative(self) -> Row {
        let factors = self
            .factors
            .into_iter()
            .map(|(end, factor)| match end.side {
                Side::Lower => (end, factor),
                Side::Upper => (end, -factor),
            });
        Row {
            factors: factors.collect(),
            bound: self.constant,
            is_strict: false,
        }
    }
}
