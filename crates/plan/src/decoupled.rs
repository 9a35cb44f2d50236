//! Boxes: an interval for each parameter.

use elbowroom_num::{End, Interval, Rational, Side};

use crate::parameter::{ParameterId, Valuation};

/// An interval for each parameter, by position (ρ in paper 1, definition 3).
///
/// As a type it is only a box. That the plan is guaranteed to work in all of it is what
/// `elbowroom-envelope` establishes.
#[doc(alias = "DRE")]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DecoupledEnvelope {
    /// One interval for each parameter; ends are closed or infinite.
    pub intervals: Vec<Interval>,
}

impl DecoupledEnvelope {
    /// The box that holds one valuation only.
    pub fn point(valuation: &[Rational]) -> Self {
        Self {
            intervals: valuation.iter().cloned().map(Interval::point).collect(),
        }
    }

    /// The interval of a parameter.
    pub fn interval(&self, id: ParameterId) -> &Interval {
        &self.intervals[id.index()]
    }

    /// Whether the valuation lies in the box.
    pub fn contains(&self, valuation: &Valuation) -> bool {
        self.intervals
            .iter()
            .zip(valuation)
            .all(|(interval, value)| interval.contains(value))
    }

    /// The valuation in this box (not empty) that is closest to another one.
    #[must_use]
    pub fn nearest(&self, valuation: &[Rational]) -> Valuation {
        let clamped = |(interval, value): (&Interval, &Rational)| {
            let value = match interval.lower.value() {
                Some(lower) => value.max(lower),
                None => value,
            };
            let value = match interval.upper.value() {
                Some(upper) => value.min(upper),
                None => value,
            };
            value.clone()
        };
        self.intervals.iter().zip(valuation).map(clamped).collect()
    }

    /// Whether every valuation of `other` lies in this box (`other` not empty).
    pub fn includes(&self, other: &Self) -> bool {
        self.intervals
            .iter()
            .zip(&other.intervals)
            .all(|(mine, theirs)| mine.intersection(theirs) == *theirs)
    }
}

/// One end of one parameter's interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BoxEnd {
    /// The parameter.
    pub parameter: ParameterId,
    /// Which end.
    pub side: Side,
}

impl BoxEnd {
    /// All ends of boxes with that many parameters: lower and upper, parameter by parameter.
    pub fn all(parameters: usize) -> impl Iterator<Item = Self> {
        (0..parameters)
            .map(ParameterId::from)
            .flat_map(|parameter| Side::BOTH.map(|side| Self { parameter, side }))
    }

    /// How far out the end lies: see [`Side::reach`].
    pub fn reach(self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        self.side.reach(envelope.interval(self.parameter))
    }

    /// The same box with this end moved.
    pub fn with_reach(
        self,
        envelope: &DecoupledEnvelope,
        reach: Option<Rational>,
    ) -> DecoupledEnvelope {
        let mut moved = envelope.clone();
        let interval = &mut moved.intervals[self.parameter.index()];
        match self.side {
            Side::Lower => {
                interval.lower = reach.map_or(End::Infinite, |reach| End::Closed(-reach));
            }
            Side::Upper => interval.upper = reach.map_or(End::Infinite, End::Closed),
        }
        moved
    }
}
