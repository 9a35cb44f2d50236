//! Rationals with an infinitesimal part.

use std::fmt;
use std::ops::{Add, Neg, Sub};

use crate::Rational;

/// `real + infinitesimal · δ`, where δ is positive and smaller than every positive rational.
///
/// The order is lexicographic. `x < c` over the rationals is `x <= c - δ` here, so a solver for
/// systems of non-strict inequalities solves strict ones too (Dutertre & de Moura, CAV 2006,
/// section 5).
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct Delta {
    /// The rational part.
    pub real: Rational,
    /// Coefficient of δ.
    pub infinitesimal: Rational,
}

impl Delta {
    /// Zero.
    pub const ZERO: Self = Self {
        real: Rational::ZERO,
        infinitesimal: Rational::ZERO,
    };

    /// Returns the number just below `real`: the bound of `x < real`.
    pub fn just_below(real: Rational) -> Self {
        Self {
            real,
            infinitesimal: Rational::from(-1),
        }
    }

    /// Returns the number just above `real`: the bound of `x > real`.
    pub fn just_above(real: Rational) -> Self {
        Self {
            real,
            infinitesimal: Rational::ONE,
        }
    }

    /// Returns `self · factor`.
    #[must_use]
    pub fn scaled(&self, factor: &Rational) -> Self {
        Self {
            real: &self.real * factor,
            infinitesimal: &self.infinitesimal * factor,
        }
    }
}

impl From<Rational> for Delta {
    fn from(real: Rational) -> Self {
        Self {
            real,
            infinitesimal: Rational::ZERO,
        }
    }
}

impl<'a> Add<&'a Delta> for &Delta {
    type Output = Delta;
    fn add(self, other: &'a Delta) -> Delta {
        Delta {
            real: &self.real + &other.real,
            infinitesimal: &self.infinitesimal + &other.infinitesimal,
        }
    }
}

impl<'a> Sub<&'a Delta> for &Delta {
    type Output = Delta;
    fn sub(self, other: &'a Delta) -> Delta {
        Delta {
            real: &self.real - &other.real,
            infinitesimal: &self.infinitesimal - &other.infinitesimal,
        }
    }
}

impl Neg for &Delta {
    type Output = Delta;
    fn neg(self) -> Delta {
        Delta {
            real: -&self.real,
            infinitesimal: -&self.infinitesimal,
        }
    }
}

impl fmt::Display for Delta {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.infinitesimal.is_zero() {
            return write!(f, "{}", self.real);
        }
        let sign = if self.infinitesimal.is_negative() {
            '-'
        } else {
            '+'
        };
        write!(f, "{} {sign} {}δ", self.real, self.infinitesimal.abs())
    }
}

impl fmt::Debug for Delta {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

#[cfg(test)]
mod tests {
    use super::{Delta, Rational};

    #[test]
    fn just_below_lies_between_every_smaller_number_and_the_number() {
        let five = Delta::from(Rational::from(5));
        let below = Delta::just_below(Rational::from(5));
        assert!(below < five);
        assert!(Delta::from(Rational::new(4_999_999, 1_000_000)) < below);
        assert!(Delta::just_above(Rational::from(5)) > five);
        assert_eq!(&below - &below, Delta::ZERO);
    }
}
