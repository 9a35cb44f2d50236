//! Densities whose logarithm is concave, everywhere or in the relevant range.

use crate::{Rational, enclosures};

/// A density.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Density {
    /// Uniform: all values between two numbers are equally likely.
    Uniform {
        /// The least value.
        from: Rational,
        /// The greatest value.
        to: Rational,
    },
    /// Triangular: rises to the mode and falls after it.
    Triangular {
        /// The least value.
        from: Rational,
        /// The likeliest value.
        mode: Rational,
        /// The greatest value.
        to: Rational,
    },
    /// Normal.
    Normal {
        /// The mean.
        mean: Rational,
        /// The standard deviation.
        deviation: Rational,
    },
    /// Exponential, shifted by `from`.
    Exponential {
        /// The least value.
        from: Rational,
        /// Mean of the exponential part.
        mean: Rational,
    },
    /// Lognormal: the logarithm is normal.
    Lognormal {
        /// The mean of the logarithm.
        location: Rational,
        /// The standard deviation of the logarithm.
        spread: Rational,
    },
}

impl Density {
    /// Returns `true` if the parameters describe a density: spreads are positive, and ends are in
    /// order.
    pub fn is_valid(&self) -> bool {
        match self {
            Self::Uniform { from, to } => from < to,
            Self::Triangular { from, mode, to } => from <= mode && mode <= to && from < to,
            Self::Normal { deviation, .. } => deviation.is_positive(),
            Self::Exponential { mean, .. } => mean.is_positive(),
            Self::Lognormal { spread, .. } => spread.is_positive(),
        }
    }

    /// Returns the least and the greatest value, if they exist.
    pub fn support(&self) -> [Option<Rational>; 2] {
        match self {
            Self::Uniform { from, to } | Self::Triangular { from, to, .. } => {
                [Some(from.clone()), Some(to.clone())]
            }
            Self::Normal { .. } => [None, None],
            Self::Exponential { from, .. } => [Some(from.clone()), None],
            Self::Lognormal { .. } => [Some(Rational::ZERO), None],
        }
    }

    /// Returns the value beyond which the logarithm of the density is not known to be concave, if
    /// there is one.
    ///
    /// The second derivative of the logarithm of a lognormal density has the sign of `ln x +
    /// spread² - location - 1`.
    pub fn concavity_limit(&self) -> Option<Rational> {
        /// Resolution of the result, which is rounded down to keep numbers short.
        const GRID: i64 = 1 << 20;
        let Self::Lognormal { location, spread } = self else {
            return None;
        };
        let logarithm = location + &Rational::ONE - spread * spread;
        let [below, above] = enclosures::exp_of_minus(&logarithm.abs());
        let bend = if logarithm.is_negative() {
            below
        } else {
            Rational::ONE.checked_div(&above).unwrap_or_default()
        };
        let grid = Rational::from(GRID);
        let short = (&bend * &grid).floor() / grid;
        Some(if short.is_positive() { short } else { bend })
    }

    /// Returns a lower and an upper bound on the probability of at most this value.
    pub fn cdf_bounds(&self, at: &Rational) -> [Rational; 2] {
        let exactly = |value: Rational| [value.clone(), value];
        let none = || exactly(Rational::ZERO);
        match self {
            Self::Uniform { from, to } => {
                let part = (at - from).max(Rational::ZERO).min(to - from);
                exactly(part.checked_div(&(to - from)).unwrap_or_default())
            }
            Self::Triangular { from, mode, to } => {
                let width = to - from;
                let square = |end: &Rational, side: &Rational| {
                    let area = (at - end) * (at - end);
                    let share = area.checked_div(&(&width * &(end - side).abs()));
                    share.unwrap_or_default()
                };
                exactly(if at <= from {
                    Rational::ZERO
                } else if at >= to {
                    Rational::ONE
                } else if at < mode {
                    square(from, mode)
                } else {
                    Rational::ONE - square(to, mode)
                })
            }
            Self::Normal { mean, deviation } => (at - mean)
                .checked_div(deviation)
                .map_or_else(none, |at| enclosures::normal_cdf(&at)),
            Self::Exponential { from, mean } => {
                let Some(times) = (at - from).checked_div(mean) else {
                    return none();
                };
                if !times.is_positive() {
                    return none();
                }
                let [below, above] = enclosures::exp_of_minus(&times);
                [
                    (Rational::ONE - above).max(Rational::ZERO),
                    Rational::ONE - below,
                ]
            }
            Self::Lognormal { .. } => match self.standardized(at) {
                Some([below, above]) => {
                    let [least, _] = enclosures::normal_cdf(&below);
                    let [_, most] = enclosures::normal_cdf(&above);
                    [least, most]
                }
                None => none(),
            },
        }
    }

    /// Returns a lower and an upper bound on the probability between two values. A missing value
    /// means that the interval is unbounded on that side.
    pub fn between(&self, [lower, upper]: [Option<&Rational>; 2]) -> [Rational; 2] {
        if let (Some(lower), Some(upper)) = (lower, upper)
            && lower >= upper
        {
            return [Rational::ZERO, Rational::ZERO];
        }
        if let (Some(lower), Some(upper)) = (lower, upper)
            && let Some(within) = self.within([lower, upper])
        {
            return within;
        }
        let [least, most] = upper.map_or([Rational::ONE, Rational::ONE], |at| self.cdf_bounds(at));
        let [under, over] =
            lower.map_or([Rational::ZERO, Rational::ZERO], |at| self.cdf_bounds(at));
        [(least - over).max(Rational::ZERO), most - under]
    }

    /// Returns a lower and an upper bound on the density. At the end of the support, it is the
    /// limit from inside.
    pub fn density_bounds(&self, at: &Rational) -> [Rational; 2] {
        let exactly = |value: Option<Rational>| {
            let value = value.unwrap_or_default();
            [value.clone(), value]
        };
        let [first, last] = self.support();
        if first.is_some_and(|first| *at < first) || last.is_some_and(|last| *at > last) {
            return exactly(None);
        }
        match self {
            Self::Uniform { from, to } => exactly((to - from).reciprocal()),
            Self::Triangular { from, mode, to } => {
                let peak = Rational::from(2)
                    .checked_div(&(to - from))
                    .unwrap_or_default();
                let part = if at < mode {
                    (at - from).checked_div(&(mode - from))
                } else {
                    (to - at).checked_div(&(to - mode))
                };
                exactly(Some(part.map_or(peak.clone(), |part| part * &peak)))
            }
            Self::Normal { mean, deviation } => {
                let standardized = (at - mean).checked_div(deviation).unwrap_or_default();
                enclosures::normal_density(&standardized)
                    .map(|own| own.checked_div(deviation).unwrap_or_default())
            }
            Self::Exponential { from, mean } => {
                let times = (at - from).checked_div(mean).unwrap_or_default();
                enclosures::exp_of_minus(&times)
                    .map(|own| own.checked_div(mean).unwrap_or_default())
            }
            Self::Lognormal { spread, .. } => {
                let Some(ends) = self.standardized(at) else {
                    return exactly(None);
                };
                let holds_peak = !ends[0].is_positive() && !ends[1].is_negative();
                let [one, other] = ends.map(|end| enclosures::normal_density(&end));
                let [_, peak] = enclosures::normal_density(&Rational::ZERO);
                let [a, b] = one;
                let [c, d] = other;
                let most = if holds_peak { peak } else { b.max(d) };
                let divisor = at * spread;
                [a.min(c), most].map(|own| own.checked_div(&divisor).unwrap_or_default())
            }
        }
    }

    /// Computes [`between`](Self::between) for normal and lognormal distributions. The difference
    /// of two results of [`at_most`](Self::at_most) would be imprecise for short intervals.
    fn within(&self, ends: [&Rational; 2]) -> Option<[Rational; 2]> {
        match self {
            Self::Normal { mean, deviation } => {
                let [Some(lower), Some(upper)] =
                    ends.map(|end| (end - mean).checked_div(deviation))
                else {
                    return None;
                };
                Some(enclosures::normal_between([&lower, &upper]))
            }
            Self::Lognormal { spread, .. } => {
                let [lower, upper] = ends;
                let places = self.standardized(lower)?;
                // The logarithm of their ratio is twice the area tangent of this part.
                let part = (upper - lower).checked_div(&(upper + lower))?;
                let twice = &part * Rational::from(2);
                let at_most = twice.checked_div(&(Rational::ONE - &part * &part))?;
                let [below, above] = enclosures::ln(&upper.checked_div(lower)?)?;
                let least = below.max(twice).checked_div(spread)?;
                let greatest = above.min(at_most).checked_div(spread)?;
                // The probability of an interval of this width rises until the middle of the
                // interval is at the peak, and falls after that.
                let at = |place: &Rational, width: &Rational| {
                    enclosures::normal_between([place, &(place + width)])
                };
                let [[first, _], [second, _]] = places.each_ref().map(|own| at(own, &least));
                let [[_, third], [_, fourth]] = places.each_ref().map(|own| at(own, &greatest));
                let middle = -&greatest / Rational::from(2);
                let most = if places[0] < middle && middle < places[1] {
                    at(&middle, &greatest)[1].clone()
                } else {
                    third.max(fourth)
                };
                Some([first.min(second), most])
            }
            _ => None,
        }
    }

    /// Returns a lower and an upper bound on the number of standard deviations by which the
    /// logarithm of a number differs from the mean; `None` if the number is not positive.
    fn standardized(&self, at: &Rational) -> Option<[Rational; 2]> {
        let Self::Lognormal { location, spread } = self else {
            return None;
        };
        let [below, above] = enclosures::ln(at)?;
        Some([
            (below - location).checked_div(spread)?,
            (above - location).checked_div(spread)?,
        ])
    }
}
