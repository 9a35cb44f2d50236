//! Upper bounds on the difference of the logarithm of a probability and a linear function.

use super::{Cell, Dense, LogConcaveDistribution, Reach, TangentPoint};
use crate::{Rational, enclosures};

/// Position of a cut relative to the intervals of a cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CutPosition {
    /// No interval of the cell reaches the cut, or there is none: the interval ends inside.
    NotReached,
    /// Some intervals reach the cut: the logarithm gains at most `gain`, in proportion to the
    /// distance to `place`.
    Open {
        /// Distance of the cut from the point.
        place: Rational,
        /// Greatest increase of the logarithm from the mass at the cut.
        gain: Rational,
    },
    /// All intervals reach the cut: everything on this side of the point is inside.
    AlwaysReached,
}

impl LogConcaveDistribution {
    /// Returns an upper bound on the difference of the logarithm of the probability and the linear
    /// function with these slopes, for all intervals around a point in a cell. The linear function
    /// is the sum of the distances of the ends from the point, each times its slope. The bound is
    /// tight, or nearly tight, if `touch` is a point of contact and the slopes are the right ones
    /// there.
    ///
    /// `None` if no bound can be computed for this point of contact.
    pub fn gap(
        &self,
        point: &Rational,
        cell: &Cell,
        touch: &TangentPoint,
        slopes: &Reach,
    ) -> Option<Rational> {
        let sides = [&cell.below, &cell.above];
        let most = |slope: &Rational, [near, far]: &[Rational; 2]| (slope * near).max(slope * far);
        match (self, touch) {
            (_, TangentPoint::NoContact) => {
                let sum = slopes
                    .iter()
                    .zip(sides)
                    .map(|(slope, side)| most(&-slope, side));
                Some(sum.sum())
            }
            (Self::Values(values), TangentPoint::Mass(mass)) => {
                let [_, mut height] = enclosures::ln(mass)?;
                height -= Rational::ONE;
                let parts = Steps::new(values, point, cell);
                height += parts.center.checked_div(mass)?;
                for ((slope, side), steps) in slopes.iter().zip(sides).zip(parts.sides) {
                    let first = (side[0].clone(), Rational::ZERO);
                    let heights = std::iter::once(first)
                        .chain(steps)
                        .map(|(place, share)| Some(share.checked_div(mass)? - slope * &place));
                    // Between steps the probability is constant, so a negative slope is worst at
                    // the far end.
                    let own = heights.collect::<Option<Vec<_>>>()?.into_iter().max()?;
                    height += if slope.is_negative() {
                        own - slope * &(&side[1] - &side[0])
                    } else {
                        own
                    };
                }
                Some(height)
            }
            (Self::Dense(dense), TangentPoint::At(at)) => {
                let seen = dense.cut_positions(point, cell)?;
                let ([least, greatest], rises) = dense.tangent(point, &seen, at)?;
                if !least.is_positive() {
                    return None;
                }
                let [_, mut height] = enclosures::ln(&greatest)?;
                for place in 0..2 {
                    let (slope, side) = (&slopes[place], sides[place]);
                    let gain = match &seen[place] {
                        CutPosition::Open { place, gain } => gain.checked_div(place)?,
                        CutPosition::NotReached | CutPosition::AlwaysReached => Rational::ZERO,
                    };
                    let own = rises[place].iter().map(|rise| {
                        let base = -(rise * &at[place]);
                        most(&(rise + &gain - slope), side) + base
                    });
                    height += own.max()?;
                }
                Some(height)
            }
            _ => None,
        }
    }
}

impl Dense {
    /// Returns the positions of the lower and the upper cut relative to the cell; `None` if the
    /// gain at a cut cannot be computed.
    pub fn cut_positions(&self, point: &Rational, cell: &Cell) -> Option<[CutPosition; 2]> {
        let [minimum, maximum] = self.effective_cuts();
        let below = minimum.as_ref().map(|cut| point - cut);
        let above = maximum.as_ref().map(|cut| cut - point);
        let simply =
            |place: &Option<Rational>, [near, far]: &[Rational; 2], is_open: bool| match place {
                Some(place) if near >= place => CutPosition::AlwaysReached,
                Some(place) if far > place || (far == place && !is_open) => CutPosition::Open {
                    place: place.clone(),
                    gain: Rational::ZERO,
                },
                _ => CutPosition::NotReached,
            };
        let mut seen = [
            simply(&below, &cell.below, cell.is_open[0]),
            simply(&above, &cell.above, cell.is_open[1]),
        ];
        let plain = seen.clone();
        for side in 0..2 {
            let CutPosition::Open { place, gain } = &mut seen[side] else {
                continue;
            };
            let mut at = [cell.below[0].clone(), cell.above[0].clone()];
            at[side].clone_from(place);
            let [inside, _] = self.density_mass(point, &plain, &at);
            let beyond = match (side, &minimum, &maximum) {
                (0, Some(cut), _) => self.density.cdf_bounds(&(cut - &self.margin))[1].clone(),
                (_, _, Some(cut)) => {
                    Rational::ONE - self.density.cdf_bounds(&(cut + &self.margin))[0].clone()
                }
                _ => Rational::ZERO,
            };
            let more = Rational::ONE + beyond.checked_div(&inside)?;
            let [_, above] = enclosures::ln(&more)?;
            *gain = above;
        }
        Some(seen)
    }

    /// Returns the ends of an interval of a cell for the density alone; `None` for a side that
    /// counts as a whole.
    fn ends(&self, point: &Rational, seen: &[CutPosition; 2], at: &Reach) -> [Option<Rational>; 2] {
        let [minimum, maximum] = self.effective_cuts();
        let lower = (seen[0] != CutPosition::AlwaysReached).then(|| {
            let end = point - &at[0];
            minimum.map_or(end.clone(), |cut| end.max(cut)) - &self.margin
        });
        let upper = (seen[1] != CutPosition::AlwaysReached).then(|| {
            let end = point + &at[1];
            maximum.map_or(end.clone(), |cut| end.min(cut)) + &self.margin
        });
        [lower, upper]
    }

    /// Returns bounds on the probability of an interval by the density alone.
    fn density_mass(&self, point: &Rational, seen: &[CutPosition; 2], at: &Reach) -> [Rational; 2] {
        let ends = self.ends(point, seen, at);
        self.density.between([ends[0].as_ref(), ends[1].as_ref()])
    }

    /// Returns bounds on the probability of an interval by the density alone, and bounds on the
    /// derivatives of its logarithm as the lower and the upper end move outwards; `None` if they
    /// are unknown.
    pub fn tangent(
        &self,
        point: &Rational,
        seen: &[CutPosition; 2],
        at: &Reach,
    ) -> Option<([Rational; 2], [[Rational; 2]; 2])> {
        let [least, greatest] = self.density_mass(point, seen, at);
        let [minimum, maximum] = self.effective_cuts();
        let is_beyond = [
            minimum.is_some_and(|cut| point - &at[0] < cut),
            maximum.is_some_and(|cut| point + &at[1] > cut),
        ];
        let ends = self.ends(point, seen, at);
        let mut rises = [const { [Rational::ZERO; 2] }; 2];
        for (side, end) in ends.iter().enumerate() {
            if let Some(end) = end
                && !is_beyond[side]
            {
                let [low, high] = self.density.density_bounds(end);
                rises[side] = [low.checked_div(&greatest)?, high.checked_div(&least)?];
            }
        }
        Some(([least, greatest], rises))
    }
}

/// Values of a list that the intervals of a cell contain: the share in all intervals, and for each
/// side the distances at which further values are added, each with the share added so far.
pub struct Steps {
    /// Share of the values that all intervals contain.
    pub center: Rational,
    /// Steps of the lower and the upper end.
    pub sides: [Vec<(Rational, Rational)>; 2],
}

impl Steps {
    /// Computes the steps for the intervals of a cell around a point.
    pub fn new(values: &[Rational], point: &Rational, cell: &Cell) -> Self {
        let one = Rational::from(i64::try_from(values.len()).unwrap_or(i64::MAX)).reciprocal();
        let one = one.unwrap_or_default();
        let mut center = Rational::ZERO;
        let mut sides = [Vec::new(), Vec::new()];
        for value in values {
            let (side, distance, [near, far]): (usize, _, _) = if value < point {
                (0, point - value, &cell.below)
            } else {
                (1, value - point, &cell.above)
            };
            if distance <= *near {
                center += &one;
            } else if distance < *far || (distance == *far && !cell.is_open[side]) {
                sides[side].push(distance);
            }
        }
        let sides = sides.map(|mut distances| {
            distances.sort_unstable();
            let mut share = Rational::ZERO;
            let steps = distances.into_iter().map(|distance| {
                share += &one;
                (distance, share.clone())
            });
            steps.collect()
        });
        Self { center, sides }
    }
}
