//! Boxes: an interval for each parameter.

use elbowroom_num::{End, Interval, Rational, Side};

use crate::parameter::ParametrizedPlan;
use crate::valuation::{ParameterId, Valuation};

/// An interval for each parameter, by position (ρ in paper 1, definition 3).
///
/// The type only represents a box. `elbowroom-envelope` establishes that the plan is guaranteed to
/// work for all values in it.
#[doc(alias = "DRE")]
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DecoupledEnvelope {
    /// One interval for each parameter; ends are closed or infinite.
    intervals: Vec<Interval>,
}

impl DecoupledEnvelope {
    /// Creates the box with these intervals for the plan's parameters, by position. Returns `None`
    /// if the number of intervals differs. Open ends become closed ones.
    pub fn new(plan: &ParametrizedPlan, intervals: Vec<Interval>) -> Option<Self> {
        let fits = intervals.len() == plan.parameters.len();
        let intervals = intervals.into_iter().map(closed).collect();
        fits.then_some(Self { intervals })
    }

    /// Returns the box of all values in the ranges of the plan's parameters.
    pub fn ranges(plan: &ParametrizedPlan) -> Self {
        let ranges = plan.parameters.iter().map(|own| closed(own.range.clone()));
        Self {
            intervals: ranges.collect(),
        }
    }

    /// Returns the box that contains a single valuation.
    pub fn point(valuation: &Valuation) -> Self {
        Self {
            intervals: valuation.iter().cloned().map(Interval::point).collect(),
        }
    }

    /// Returns `true` if the box contains a single valuation.
    pub fn is_point(&self) -> bool {
        let mut intervals = self.intervals.iter();
        intervals.all(|own| own.lower.value().is_some() && own.lower.value() == own.upper.value())
    }

    /// Returns the intervals, one for each parameter, by position. Their ends are closed or
    /// infinite.
    pub fn intervals(&self) -> &[Interval] {
        &self.intervals
    }

    /// Returns the interval of a parameter.
    pub fn interval(&self, id: ParameterId) -> &Interval {
        &self.intervals[id.index()]
    }

    /// Returns the box with another interval for the parameter. Open ends become closed ones.
    #[must_use]
    pub fn with_interval(mut self, id: ParameterId, interval: Interval) -> Self {
        self.intervals[id.index()] = closed(interval);
        self
    }

    /// Sets the reach of an end ([`BoxEnd::reach`]); `None` is infinite.
    pub fn set_reach(&mut self, end: BoxEnd, reach: Option<Rational>) {
        let interval = &mut self.intervals[end.parameter.index()];
        match end.side {
            Side::Lower => {
                interval.lower = reach.map_or(End::Infinite, |reach| End::Closed(-reach));
            }
            Side::Upper => interval.upper = reach.map_or(End::Infinite, End::Closed),
        }
    }

    /// Returns `true` if the box contains the valuation.
    pub fn contains(&self, valuation: &Valuation) -> bool {
        self.intervals
            .iter()
            .zip(valuation)
            .all(|(interval, value)| interval.contains(value))
    }

    /// Returns the valuation in this non-empty box that is closest to another one.
    #[must_use]
    pub fn nearest(&self, valuation: &Valuation) -> Valuation {
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

    /// Returns `true` if the box contains every valuation of `other`, which must not be empty.
    pub fn includes(&self, other: &Self) -> bool {
        self.intervals
            .iter()
            .zip(&other.intervals)
            .all(|(mine, theirs)| mine.intersection(theirs) == *theirs)
    }
}

/// Returns the interval with its finite ends closed.
fn closed(interval: Interval) -> Interval {
    let closed = |end| match end {
        End::Open(value) => End::Closed(value),
        End::Closed(_) | End::Infinite => end,
    };
    Interval {
        lower: closed(interval.lower),
        upper: closed(interval.upper),
    }
}

/// One end of one parameter's interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BoxEnd {
    /// The parameter.
    pub parameter: ParameterId,
    /// The end.
    pub side: Side,
}

impl BoxEnd {
    /// Returns all ends of boxes with that many parameters: lower and upper, parameter by
    /// parameter.
    pub fn all(parameters: usize) -> impl Iterator<Item = Self> {
        (0..parameters)
            .map(ParameterId::from)
            .flat_map(|parameter| Side::BOTH.map(|side| Self { parameter, side }))
    }

    /// Returns the reach of the end; see [`Side::reach`].
    pub fn reach(self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        self.side.reach(envelope.interval(self.parameter))
    }

    /// Returns the box with this end moved.
    pub fn with_reach(
        self,
        envelope: &DecoupledEnvelope,
        reach: Option<Rational>,
    ) -> DecoupledEnvelope {
        let mut moved = envelope.clone();
        moved.set_reach(self, reach);
        moved
    }
}
