//! Linear inequalities on all boxes, learnt from a refused box: [`Cut`].

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, Origin, Side};

use crate::row::Row;
use crate::soundness::Broken;

/// At least one of these rows holds in every box inside the envelope, and none of them in the box
/// that was refused.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The alternatives; mostly one.
    pub rows: Vec<Row>,
    /// Proof that every box inside the envelope satisfies one of them.
    pub ground: Ground,
}

/// Proof that one of the rows of a [`Cut`] holds in every box inside the envelope.
#[derive(Clone, Debug, PartialEq)]
pub enum Ground {
    /// The bounds of these constraints, which follow each other in a circle, add up to less than
    /// nothing for some values in a box that breaks the row: these have no schedule.
    Cycle(Vec<Origin>),
    /// The same, of bounds that a schedule fixed in advance has to satisfy for the worst values:
    /// each constraint with the constraints of the durations that end early or late before it.
    Fixed(Vec<ProofPart>),
    /// A semi-reducible cycle: rule by rule, why no strategy exists in a box that breaks all rows.
    Semireducible(Vec<ProofWay>),
    /// A condition that some schedule breaks for some values in a box that breaks the row.
    Condition(Broken),
    /// A box that breaks all rows includes this one, which the oracle refuses.
    Box(DecoupledEnvelope),
}

/// Parts of a way one after the other: [`elbowroom_stn::uncertain::Way`], in terms of a plan.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ProofWay {
    /// Each begins where the one before ends.
    pub parts: Vec<ProofPart>,
    /// The way counts for at least minus the lower end of the duration that this constraint leaves
    /// open, by position in the plan.
    pub unlabelled: Option<usize>,
}

/// One part of a way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ProofPart {
    /// A bound that has to be kept.
    Bound(Origin),
    /// The duration that this constraint leaves open, at its lower end.
    Early(usize),
    /// The same at its upper end, walked backwards.
    Late(usize),
    /// A way that counts as one bound.
    Way(ProofWay),
}

impl Cut {
    /// Returns `true` if one of the rows holds in a box.
    pub fn holds_in(&self, envelope: &DecoupledEnvelope) -> bool {
        self.rows.iter().any(|row| row.holds_in(envelope))
    }
}

/// `constant + Σ factor · end`, where an end is the number itself: what a cycle of bounds adds up
/// to.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Ends {
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
    /// In a box; `None` if it is infinite.
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

impl From<Length> for Ends {
    fn from(length: Length) -> Self {
        let mut ends = Self::default();
        ends.add_length(&length);
        ends
    }
}

impl Ends {
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

    /// The sum in a box; `None` if an infinite end counts.
    pub(crate) fn value(&self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        let mut sum = self.constant.clone();
        for (end, factor) in &self.factors {
            let interval = envelope.interval(end.parameter);
            sum += factor * end.side.of(interval).value()?;
        }
        Some(sum)
    }

    /// Returns `true` if a parameter occurs with both of its ends.
    pub(crate) fn tears(&self) -> bool {
        let ends: Vec<&BoxEnd> = self.factors.keys().collect();
        ends.windows(2)
            .any(|pair| pair[0].parameter == pair[1].parameter)
    }

    /// That it is not negative.
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
