//! Intervals of rationals.

use std::fmt;

use crate::Rational;

/// One end of an [`Interval`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum End {
    /// The number itself belongs to the interval.
    Closed(Rational),
    /// The interval comes arbitrarily close to the number, and excludes it.
    Open(Rational),
    /// No limit on this side.
    Infinite,
}

impl End {
    /// Returns the number at this end, unless it is infinite.
    pub fn value(&self) -> Option<&Rational> {
        match self {
            End::Closed(value) | End::Open(value) => Some(value),
            End::Infinite => None,
        }
    }

    /// Returns `true` if there is no limit on this side.
    pub fn is_infinite(&self) -> bool {
        matches!(self, End::Infinite)
    }
}

/// All rationals between a lower and an upper end.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Interval {
    /// Lower end of the interval.
    pub lower: End,
    /// Upper end of the interval.
    pub upper: End,
}

impl Interval {
    /// All rationals.
    pub const EVERYTHING: Self = Self {
        lower: End::Infinite,
        upper: End::Infinite,
    };

    /// Returns `[lower, upper]`.
    pub fn closed(lower: Rational, upper: Rational) -> Self {
        Self {
            lower: End::Closed(lower),
            upper: End::Closed(upper),
        }
    }

    /// Returns `[value, value]`.
    pub fn point(value: Rational) -> Self {
        Self::closed(value.clone(), value)
    }

    /// Returns `[lower, inf)`.
    pub fn at_least(lower: Rational) -> Self {
        Self {
            lower: End::Closed(lower),
            upper: End::Infinite,
        }
    }

    /// Returns `(-inf, upper]`.
    pub fn at_most(upper: Rational) -> Self {
        Self {
            lower: End::Infinite,
            upper: End::Closed(upper),
        }
    }

    /// Returns `true` if `value` belongs to the interval.
    pub fn contains(&self, value: &Rational) -> bool {
        let above = match &self.lower {
            End::Closed(lower) => value >= lower,
            End::Open(lower) => value > lower,
            End::Infinite => true,
        };
        let below = match &self.upper {
            End::Closed(upper) => value <= upper,
            End::Open(upper) => value < upper,
            End::Infinite => true,
        };
        above && below
    }

    /// Returns `true` if no rational belongs to the interval.
    pub fn is_empty(&self) -> bool {
        match (&self.lower, &self.upper) {
            (End::Infinite, _) | (_, End::Infinite) => false,
            (End::Closed(lower), End::Closed(upper)) => lower > upper,
            (End::Closed(lower) | End::Open(lower), End::Closed(upper) | End::Open(upper)) => {
                lower >= upper
            }
        }
    }

    /// Returns `upper - lower`, or `None` when an end is infinite.
    pub fn width(&self) -> Option<Rational> {
        Some(self.upper.value()? - self.lower.value()?)
    }

    /// Returns the intersection of both intervals.
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        Self {
            lower: tighter(&self.lower, &other.lower, |a, b| a > b),
            upper: tighter(&self.upper, &other.upper, |a, b| a < b),
        }
    }
}

/// Returns the end that excludes more; `is_tighter(a, b)` compares two distinct finite ends.
fn tighter(a: &End, b: &End, is_tighter: fn(&Rational, &Rational) -> bool) -> End {
    match (a.value(), b.value()) {
        (None, _) => b.clone(),
        (_, None) => a.clone(),
        (Some(x), Some(y)) if x == y => {
            if matches!(a, End::Open(_)) {
                a.clone()
            } else {
                b.clone()
            }
        }
        (Some(x), Some(y)) => {
            if is_tighter(x, y) {
                a.clone()
            } else {
                b.clone()
            }
        }
    }
}

/// `[1, 5/2]`, `(0, inf)`.
impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.lower {
            End::Closed(lower) => write!(f, "[{lower}, ")?,
            End::Open(lower) => write!(f, "({lower}, ")?,
            End::Infinite => write!(f, "(-inf, ")?,
        }
        match &self.upper {
            End::Closed(upper) => write!(f, "{upper}]"),
            End::Open(upper) => write!(f, "{upper})"),
            End::Infinite => write!(f, "inf)"),
        }
    }
}

/// The lower or the upper end of an interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// The lower end.
    Lower,
    /// The upper end.
    Upper,
}

impl Side {
    /// Both, the lower first: the order of an array with one entry for each.
    pub const BOTH: [Self; 2] = [Self::Lower, Self::Upper];

    /// Returns the other end.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Lower => Self::Upper,
            Self::Upper => Self::Lower,
        }
    }

    /// Returns its position in [`BOTH`](Self::BOTH).
    pub fn index(self) -> usize {
        match self {
            Self::Lower => 0,
            Self::Upper => 1,
        }
    }

    /// Returns this end of an interval.
    pub fn of(self, interval: &Interval) -> &End {
        match self {
            Self::Lower => &interval.lower,
            Self::Upper => &interval.upper,
        }
    }

    /// Returns the reach of this end of an interval: the upper end itself, or the negated lower
    /// end; `None` if infinite. Widening the interval makes it greater.
    pub fn reach(self, interval: &Interval) -> Option<Rational> {
        let value = self.of(interval).value()?;
        Some(match self {
            Self::Lower => -value,
            Self::Upper => value.clone(),
        })
    }

    /// Returns the number at which this end of an interval lies if its [`reach`](Self::reach) is
    /// `reach`.
    pub fn value_at_reach(self, reach: &Rational) -> Rational {
        match self {
            Self::Lower => -reach,
            Self::Upper => reach.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{End, Interval, Rational};

    #[test]
    fn open_ends_exclude_their_number() {
        let interval = Interval {
            lower: End::Open(Rational::ZERO),
            upper: End::Infinite,
        };
        assert!(!interval.contains(&Rational::ZERO));
        assert!(interval.contains(&Rational::new(1, 1_000_000)));
        assert_eq!(interval.to_string(), "(0, inf)");
    }

    #[test]
    fn an_intersection_takes_the_tighter_end_on_each_side() {
        let a = Interval::closed(Rational::ZERO, Rational::from(5));
        let b = Interval {
            lower: End::Open(Rational::ZERO),
            upper: End::Infinite,
        };
        let both = a.intersection(&b);
        assert_eq!(both.to_string(), "(0, 5]");
        assert!(!both.is_empty());
        assert!(Interval::closed(Rational::ONE, Rational::ZERO).is_empty());
    }
}
