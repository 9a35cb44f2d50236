//! Fractions as whole numbers of one unit.

use crate::Rational;

/// A common denominator of some fractions: multiplied by it, each of them is a whole number.
///
/// Sums, differences and comparisons of the whole numbers are those of the fractions, and several
/// times faster. The caller must ensure that sums do not overflow.
///
/// ```
/// use elbowroom_num::{CommonDenominator, Rational};
///
/// let times = [Rational::new(1, 2), Rational::new(1, 3)];
/// let unit = CommonDenominator::of(&times).expect("small numbers");
/// assert_eq!(unit.to_integer(&times[0]), Some(3));
/// assert_eq!(unit.to_integer(&Rational::new(1, 4)), None);
/// assert_eq!(unit.to_fraction(5), Rational::new(5, 6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CommonDenominator(i64);

impl Default for CommonDenominator {
    fn default() -> Self {
        Self(1)
    }
}

impl CommonDenominator {
    /// Returns the least common denominator of these numbers; `None` if it, or one of the numbers,
    /// does not fit an `i64`.
    pub fn of<'a>(numbers: impl IntoIterator<Item = &'a Rational>) -> Option<Self> {
        let mut common = Self::default();
        for number in numbers {
            common.include(number)?;
        }
        Some(common)
    }

    /// Extends the denominator so that it is also one of this number. Returns `None` and leaves it
    /// unchanged if the result does not fit an `i64`.
    pub fn include(&mut self, number: &Rational) -> Option<()> {
        let (_, own) = number.as_small()?;
        if self.0 % own != 0 {
            self.0 = (self.0 / gcd(self.0, own)).checked_mul(own)?;
        }
        Some(())
    }

    /// Returns the number multiplied by the denominator; `None` if that is not a whole number, or
    /// does not fit an `i64`.
    pub fn to_integer(self, number: &Rational) -> Option<i64> {
        let (numerator, own) = number.as_small()?;
        (self.0 % own == 0).then(|| numerator.checked_mul(self.0 / own))?
    }

    /// Returns the whole number divided by the denominator.
    pub fn to_fraction(self, whole: i64) -> Rational {
        Rational::new(whole, self.0)
    }

    /// Returns the denominator itself; positive.
    pub fn get(self) -> i64 {
        self.0
    }
}

/// Returns the greatest common divisor of two positive numbers.
fn gcd(a: i64, b: i64) -> i64 {
    let shared = crate::rational::gcd(a.unsigned_abs().into(), b.unsigned_abs().into());
    i64::try_from(shared).expect("it divides them")
}

#[cfg(test)]
mod tests {
    use super::CommonDenominator;
    use crate::Rational;

    #[test]
    fn common_denominator_is_least_and_round_trips() {
        let numbers = [(1, 6), (-3, 4), (7, 1), (0, 5)].map(|(n, d)| Rational::new(n, d));
        let common = CommonDenominator::of(&numbers).expect("small");
        assert_eq!(common.get(), 12);
        for number in &numbers {
            let whole = common.to_integer(number).expect("whole");
            assert_eq!(&common.to_fraction(whole), number);
        }
    }

    #[test]
    fn overflowing_numbers_are_refused() {
        let large = Rational::new(1, i64::MAX);
        let mut common = CommonDenominator::of([&large]).expect("fits");
        assert_eq!(common.include(&Rational::new(1, 2)), None);
        assert_eq!(common.get(), i64::MAX);
        assert_eq!(common.to_integer(&Rational::new(2, 1)), None);
        let beyond = &Rational::from(i64::MAX) * &Rational::from(i64::MAX);
        assert_eq!(CommonDenominator::of([&beyond]), None);
    }
}
