//! Numbers extended by infinities, with exact sums.

use std::cmp::Ordering;

use crate::Weight;

/// `infinite · ∞ + finite`, where ∞ is greater than every finite number.
///
/// A contingent link without an upper bound may exceed any duration. Representing it by one
/// symbolic number above all others keeps sums and comparisons exact.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Extended<W> {
    /// Number of infinities.
    pub infinite: i64,
    /// The finite part.
    pub finite: W,
}

impl<W: Weight> Extended<W> {
    /// Returns infinity.
    pub fn infinity() -> Self {
        Self {
            infinite: 1,
            finite: W::zero(),
        }
    }

    /// Returns the number itself; `None` if it is infinite.
    pub fn into_finite(self) -> Option<W> {
        (self.infinite == 0).then_some(self.finite)
    }

    /// Returns the same number with another finite part.
    pub(crate) fn map<V>(self, number: impl FnOnce(W) -> V) -> Extended<V> {
        Extended {
            infinite: self.infinite,
            finite: number(self.finite),
        }
    }

    pub(crate) fn is_negative(&self) -> bool {
        *self < Self::zero()
    }
}

impl<W> From<W> for Extended<W> {
    fn from(finite: W) -> Self {
        Self {
            infinite: 0,
            finite,
        }
    }
}

impl<W: Ord> PartialOrd for Extended<W> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl<W: Ord> Ord for Extended<W> {
    fn cmp(&self, other: &Self) -> Ordering {
        let infinite = self.infinite.cmp(&other.infinite);
        infinite.then_with(|| self.finite.cmp(&other.finite))
    }
}

impl<W: Weight> Weight for Extended<W> {
    fn zero() -> Self {
        Self::from(W::zero())
    }

    fn plus(&self, other: &Self) -> Self {
        Self {
            infinite: self.infinite + other.infinite,
            finite: self.finite.plus(&other.finite),
        }
    }

    fn minus(&self, other: &Self) -> Self {
        Self {
            infinite: self.infinite - other.infinite,
            finite: self.finite.minus(&other.finite),
        }
    }
}
