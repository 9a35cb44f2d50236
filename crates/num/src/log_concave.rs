//! Bounds on the probability that a random number lies in an interval, as fractions.
//!
//! A [`Chance`] is a user-stated distribution: either a density whose logarithm is concave, cut at
//! both sides (values beyond a cut are moved to the cut), or a list of values. A [`Reach`] is an
//! interval around a point, given by the distances of its ends from the point. A [`Cell`] is a
//! rectangle of reaches. [`Chance::height`] bounds how far the logarithm of the probability rises
//! above a linear function for all intervals of a cell. Branch and bound uses that bound to prove
//! an interval optimal.
//!
//! For a density with a concave logarithm, the logarithm of the probability of an interval is a
//! jointly concave function of its ends (Prékopa 1973), and lies below each of its tangents. The
//! probability mass at a cut is either inside the interval or not. If the intervals of a cell
//! differ in that, the mass counts with a share that grows with the reach. For a list of values, a
//! cell counts the values that its intervals may contain.

mod density;
mod gap;

use crate::Rational;

pub use density::Density;
pub use gap::{CutPosition, Steps};

/// Distribution of a number that is rounded to multiples of a resolution.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LogConcaveDistribution {
    /// A density; only the mass at its cuts is discrete.
    Dense(Dense),
    /// Equally likely values; sorted, at least one.
    Values(Vec<Rational>),
}

/// A density, cut at both sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dense {
    /// The density.
    pub density: Density,
    /// Lower cut: lesser numbers become this.
    pub minimum: Option<Rational>,
    /// Upper cut: greater numbers become this.
    pub maximum: Option<Rational>,
    /// Length added to an interval at either end: half of the rounding resolution.
    pub margin: Rational,
}

/// Distances of the lower and the upper end of an interval from a point inside it.
pub type Reach = [Rational; 2];

/// Set of intervals around a point: the distances of the lower end and of the upper end each lie
/// within a range.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cell {
    /// The least and the greatest distance of the lower end.
    pub below: [Rational; 2],
    /// The least and the greatest distance of the upper end.
    pub above: [Rational; 2],
    /// For the lower and the upper end, `true` if the greatest distance is excluded.
    pub is_open: [bool; 2],
}

/// Place where a linear bound on a probability is tight, or nearly tight.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TangentPoint {
    /// At this interval.
    At(Reach),
    /// At intervals with this probability.
    Mass(Rational),
    /// Nowhere: no probability is more than 1.
    NoContact,
}

impl LogConcaveDistribution {
    /// Creates the distribution of a list of equally likely values.
    ///
    /// `None` if the list is empty.
    pub fn values(mut values: Vec<Rational>) -> Option<Self> {
        values.sort_unstable();
        (!values.is_empty()).then_some(Self::Values(values))
    }

    /// Creates the distribution of a number with this density, cut at both sides and rounded to
    /// multiples of `resolution`. Cuts without any mass are dropped. If a cut has all the mass, the
    /// result is a single value.
    ///
    /// `None` if the density is invalid ([`Density::is_sound`]).
    pub fn dense(
        density: Density,
        minimum: Option<Rational>,
        maximum: Option<Rational>,
        resolution: &Rational,
    ) -> Option<Self> {
        if !density.is_valid() {
            return None;
        }
        let round = |cut: Rational| {
            (cut.checked_div(resolution).unwrap_or_default() + Rational::new(1, 2)).floor()
                * resolution
        };
        let [first, last] = density.support();
        let is_beyond = |cut: &Rational, end: &Option<Rational>| end.as_ref() >= Some(cut);
        let minimum = minimum.map(round).filter(|cut| !is_beyond(cut, &first));
        let maximum = maximum.map(round);
        let maximum = maximum.filter(|cut| last.as_ref().is_none_or(|last| cut < last));
        // The upper cut is applied last.
        let ends = [&maximum, &minimum];
        if let [Some(maximum), Some(minimum)] = ends
            && maximum <= minimum
        {
            return Some(Self::Values(vec![maximum.clone()]));
        }
        if let Some(minimum) = &minimum
            && last.as_ref().is_some_and(|last| last <= minimum)
        {
            return Some(Self::Values(vec![minimum.clone()]));
        }
        if let Some(maximum) = &maximum
            && first.as_ref().is_some_and(|first| first >= maximum)
        {
            return Some(Self::Values(vec![maximum.clone()]));
        }
        Some(Self::Dense(Dense {
            density,
            minimum,
            maximum,
            margin: resolution / &Rational::from(2),
        }))
    }

    /// Returns a lower bound on the probability that the number, rounded to a multiple of
    /// `resolution`, lies in the closed interval with these ends.
    pub fn probability_inside(
        &self,
        [lower, upper]: [&Rational; 2],
        resolution: &Rational,
    ) -> Rational {
        match self {
            Self::Values(values) => share(values, |own| lower <= own && own <= upper),
            Self::Dense(dense) => {
                let steps = |end: &Rational| end.checked_div(resolution).unwrap_or_default();
                let half = resolution / &Rational::from(2);
                let first = steps(lower).ceil() * resolution;
                let last = steps(upper).floor() * resolution;
                if first > last {
                    return Rational::ZERO;
                }
                let is_low = dense.minimum.as_ref().is_some_and(|cut| first <= *cut);
                let is_high = dense.maximum.as_ref().is_some_and(|cut| *cut <= last);
                let is_before = dense.minimum.as_ref().is_some_and(|cut| last < *cut);
                let is_after = dense.maximum.as_ref().is_some_and(|cut| *cut < first);
                if is_before || is_after {
                    return Rational::ZERO;
                }
                let below = (!is_low).then(|| first - &half);
                let above = (!is_high).then(|| last + &half);
                let [below, _] = dense.density.between([below.as_ref(), above.as_ref()]);
                below
            }
        }
    }

    /// Returns bounds on the probability of an interval around a point, extended by the margin.
    pub fn probability_bounds(&self, point: &Rational, [below, above]: &Reach) -> [Rational; 2] {
        let (lower, upper) = (point - below, point + above);
        match self {
            Self::Values(values) => {
                let share = share(values, |own| lower <= *own && *own <= upper);
                [share.clone(), share]
            }
            Self::Dense(dense) => {
                let is_out = dense.minimum.as_ref().is_some_and(|cut| upper < *cut)
                    || dense.maximum.as_ref().is_some_and(|cut| *cut < lower);
                if is_out {
                    return [Rational::ZERO, Rational::ZERO];
                }
                let is_low = dense.minimum.as_ref().is_some_and(|cut| lower <= *cut);
                let is_high = dense.maximum.as_ref().is_some_and(|cut| *cut <= upper);
                let lower = (!is_low).then(|| lower - &dense.margin);
                let upper = (!is_high).then(|| upper + &dense.margin);
                let ends = [lower.as_ref(), upper.as_ref()];
                dense.density.between(ends)
            }
        }
    }

    /// Returns, for the lower and the upper end, the distance from a point from which the interval
    /// has any probability, and the distance beyond which it gains none.
    ///
    /// With a lognormal density, the latter is where its logarithm is no longer concave.
    pub fn limits(&self, point: &Rational) -> [(Rational, Option<Rational>); 2] {
        let positive = |distance: Rational| distance.max(Rational::ZERO);
        let ([first, last], [gains_below, gains_above]) = match self {
            Self::Values(values) => {
                let ends = [values.first().cloned(), values.last().cloned()];
                (ends.clone(), ends)
            }
            Self::Dense(dense) => {
                let [first, last] = dense.density.support();
                let margin = &dense.margin;
                let beyond = [
                    first.as_ref().map(|first| first - margin),
                    last.as_ref().map(|last| last + margin),
                ];
                let [lower, upper] = dense.effective_cuts();
                let [beyond_first, beyond_last] = beyond;
                let first_here = dense.minimum.clone().or(beyond_first);
                let last_here = dense.maximum.clone().or(beyond_last);
                let gains = [
                    lower.or(first.map(|first| first + margin)),
                    upper.or(last.map(|last| last - margin)),
                ];
                ([first_here, last_here], gains)
            }
        };
        let least_below = positive(last.map_or(Rational::ZERO, |last| point - &last));
        let least_above = positive(first.map_or(Rational::ZERO, |first| &first - point));
        let most_below = gains_below.map(|first| (point - &first).max(least_below.clone()));
        let most_above = gains_above.map(|last| (&last - point).max(least_above.clone()));
        [(least_below, most_below), (least_above, most_above)]
    }

    /// Returns the distances at which the probability of an interval around a point jumps, for the
    /// lower and the upper end, in ascending order.
    pub fn jumps(&self, point: &Rational) -> [Vec<Rational>; 2] {
        match self {
            Self::Values(values) => {
                let mut below: Vec<Rational> = values
                    .iter()
                    .rev()
                    .filter(|own| *own < point)
                    .map(|own| point - own)
                    .collect();
                let above = values.iter().filter(|own| *own > point);
                let mut above: Vec<Rational> = above.map(|own| own - point).collect();
                below.dedup();
                above.dedup();
                [below, above]
            }
            Self::Dense(dense) => {
                let [lower, upper] = dense.effective_cuts();
                let below = lower.map(|cut| point - &cut);
                let above = upper.map(|cut| &cut - point);
                [below, above].map(|own| own.into_iter().filter(Rational::is_positive).collect())
            }
        }
    }
}

impl Dense {
    /// Returns the cuts that the bounds on the probability use. The logarithm of the density is not
    /// concave beyond the bend. If the bend comes before the upper cut, all mass beyond the bend
    /// counts as if it were at the bend.
    pub(crate) fn effective_cuts(&self) -> [Option<Rational>; 2] {
        let bend = self
            .density
            .concavity_limit()
            .map(|bend| bend - &self.margin);
        let upper = match (self.maximum.clone(), bend) {
            (Some(cut), Some(bend)) => Some(cut.min(bend)),
            (cut, bend) => cut.or(bend),
        };
        [self.minimum.clone(), upper]
    }
}

/// Returns the share of the values that satisfy a condition.
fn share(values: &[Rational], is_in: impl Fn(&Rational) -> bool) -> Rational {
    let count = |count: usize| Rational::from(i64::try_from(count).unwrap_or(i64::MAX));
    let inside = values.iter().filter(|own| is_in(own)).count();
    count(inside)
        .checked_div(&count(values.len()))
        .unwrap_or_default()
}
