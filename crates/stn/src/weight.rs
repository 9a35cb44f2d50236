//! Number types for bounds.

use std::fmt::Debug;

use elbowroom_num::{Delta, Rational};

/// Exact number type for bounds on differences of times: an ordered group.
///
/// The order is compatible with addition (`a <= b` implies `a + c <= b + c`). The algorithms of
/// this crate rely on nothing else.
pub trait Weight: Clone + Ord + Debug {
    /// Returns the neutral element of [`Weight::plus`].
    fn zero() -> Self;
    /// Returns `self + other`.
    #[must_use]
    fn plus(&self, other: &Self) -> Self;
    /// Returns `self - other`.
    #[must_use]
    fn minus(&self, other: &Self) -> Self;
    /// Returns `-self`.
    #[must_use]
    fn negated(&self) -> Self {
        Self::zero().minus(self)
    }
}

impl Weight for Rational {
    fn zero() -> Self {
        Rational::ZERO
    }
    fn plus(&self, other: &Self) -> Self {
        self + other
    }
    fn minus(&self, other: &Self) -> Self {
        self - other
    }
    fn negated(&self) -> Self {
        -self
    }
}

/// `to - from < bound` is the constraint with `Delta::just_below(bound)`.
impl Weight for Delta {
    fn zero() -> Self {
        Delta::ZERO
    }
    fn plus(&self, other: &Self) -> Self {
        self + other
    }
    fn minus(&self, other: &Self) -> Self {
        self - other
    }
    fn negated(&self) -> Self {
        -self
    }
}

/// Machine integers, for times scaled to a common denominator.
macro_rules! machine_integer {
    ($($integer:ty),*) => {$(
        /// # Panics
        /// If a sum does not fit, because a wrong result would be worse.
        impl Weight for $integer {
            fn zero() -> Self {
                0
            }
            fn plus(&self, other: &Self) -> Self {
                self.checked_add(*other).expect("sums of bounds fit the chosen integer type")
            }
            fn minus(&self, other: &Self) -> Self {
                self.checked_sub(*other).expect("sums of bounds fit the chosen integer type")
            }
        }
    )*};
}
machine_integer!(i64, i128);
