//! Sums of many products: [`Accumulator`].

use crate::Rational;

/// Accumulator for a sum of fractions.
///
/// Repeated addition reduces each partial sum to lowest terms. This type reduces once, at the end,
/// as long as the numbers are small.
///
/// ```
/// use elbowroom_num::{Rational, Accumulator};
///
/// let mut total = Accumulator::default();
/// total.add(&Rational::new(1, 3));
/// total.add_product(&Rational::new(1, 6), &Rational::from(4));
/// assert_eq!(total.value(), Rational::ONE);
/// ```
#[derive(Clone, Debug)]
pub struct Accumulator {
    /// Sum of the terms that did not fit into `numerator / denominator`.
    large: Rational,
    numerator: i128,
    /// Positive.
    denominator: i64,
}

impl Default for Accumulator {
    fn default() -> Self {
        Self {
            large: Rational::ZERO,
            numerator: 0,
            denominator: 1,
        }
    }
}

impl Accumulator {
    /// Adds a number.
    pub fn add(&mut self, number: &Rational) {
        self.add_product(number, &Rational::ONE);
    }

    /// Adds the product of two numbers.
    pub fn add_product(&mut self, left: &Rational, right: &Rational) {
        if self.try_add_product(left, right).is_none() {
            self.large += &(left * right);
        }
    }

    /// Adds a product of small numbers. Returns `None` and adds nothing if the sum is not small.
    fn try_add_product(&mut self, left: &Rational, right: &Rational) -> Option<()> {
        let ((a, b), (c, d)) = (left.as_small()?, right.as_small()?);
        let numerator = i128::from(a) * i128::from(c);
        let denominator = b.checked_mul(d)?;
        if denominator == self.denominator {
            self.numerator = self.numerator.checked_add(numerator)?;
            return Some(());
        }
        if self.denominator % denominator == 0 {
            let factor = i128::from(self.denominator / denominator);
            self.numerator = self.numerator.checked_add(numerator.checked_mul(factor)?)?;
            return Some(());
        }
        // The product of the denominators may be too large although a smaller common denominator
        // exists. The term is then added separately.
        let (own, other) = (i128::from(self.denominator), i128::from(denominator));
        let common = if denominator % self.denominator == 0 {
            denominator
        } else {
            self.denominator.checked_mul(denominator)?
        };
        let scaled = self.numerator.checked_mul(i128::from(common) / own)?;
        let term = numerator.checked_mul(i128::from(common) / other)?;
        self.numerator = scaled.checked_add(term)?;
        self.denominator = common;
        Some(())
    }

    /// Returns the sum.
    pub fn value(&self) -> Rational {
        &self.large + &Rational::reduced(self.numerator, i128::from(self.denominator))
    }
}

#[cfg(test)]
mod tests {
    use super::{Accumulator, Rational};

    /// Returns numbers of all sizes, the same each time.
    fn numbers() -> impl Iterator<Item = Rational> {
        let mut state = 0x2545_f491_4f6c_dd1d_u64;
        std::iter::repeat_with(move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            let bits = state % 64;
            let numerator = (state.rotate_left(20) >> bits).cast_signed();
            let denominator = [1, 1, 2, 3, 1000, 1 << 31, 1_000_003, i64::MAX]
                [(state / 64 % 8).try_into().unwrap_or(0_usize)];
            let small = Rational::new(numerator.max(-i64::MAX), denominator);
            if state.is_multiple_of(97) {
                &small * &small
            } else {
                small
            }
        })
    }

    #[test]
    fn total_equals_sum_of_terms() {
        let mut numbers = numbers();
        for count in 0..400 {
            let mut total = Accumulator::default();
            let mut sum = Rational::ZERO;
            for _ in 0..count % 40 {
                let (left, right) = (numbers.next().unwrap(), numbers.next().unwrap());
                total.add_product(&left, &right);
                total.add(&right);
                sum += &(&left * &right);
                sum += &right;
            }
            assert_eq!(total.value(), sum);
        }
    }

    #[test]
    fn sums_that_do_not_fit_are_exact_as_well() {
        let most = Rational::from(i64::MAX);
        let mut total = Accumulator::default();
        for _ in 0..8 {
            total.add_product(&most, &most);
        }
        assert_eq!(total.value(), &(&most * &most) * &Rational::from(8));
    }
}
