//! Enclosures of functions with irrational values, between two fractions.
//!
//! Each result is an interval that certainly contains the true value. It is computed with whole
//! numbers in units of 2^-60, and every rounding error is counted.

mod normal;

pub use normal::{exp_of_minus, normal_between, normal_cdf, normal_density};

use crate::Rational;

/// One, in units of 2^-60.
const ONE: i128 = 1 << 60;
/// The logarithm of 2 in these units, rounded down.
const LN_2: i128 = 0x0B17_217F_7D1C_F79A;
/// Upper bound on the rounding errors of a logarithm's series, in these units.
const ROUNDING_ERROR: i128 = 64;

/// Returns bounds on the natural logarithm that are less than 10^-15 apart, unless the argument is
/// astronomically large or small; `None` unless the argument is positive.
///
/// With `m·2^k` as the argument and `m` between 3/4 and 3/2, it is `k` times the logarithm of 2
/// plus twice the area tangent of `(m - 1) / (m + 1)`. In that series, each term is less than a
/// 25th of the previous one.
///
/// ```
/// use elbowroom_num::{Rational, enclosures};
///
/// let [below, above] = enclosures::ln(&Rational::from(10)).ok_or("10 is positive")?;
/// assert!(below < above && above.to_decimal(12) == "2.302585092994");
/// assert_eq!(enclosures::ln(&Rational::ZERO), None);
/// # Ok::<(), &str>(())
/// ```
pub fn ln(argument: &Rational) -> Option<[Rational; 2]> {
    if !argument.is_positive() {
        return None;
    }
    let (mantissa, power) = split_exponent(argument);
    let ratio = (&mantissa - &Rational::ONE).checked_div(&(&mantissa + &Rational::ONE))?;
    let ratio = i128::from(steps(&ratio)?);
    let square = ratio * ratio / ONE;
    let (mut sum, mut power_of_ratio, mut odd) = (0, ratio, 1);
    while power_of_ratio != 0 {
        sum += power_of_ratio / odd;
        power_of_ratio = power_of_ratio * square / ONE;
        odd += 2;
    }
    let unit = Rational::from(i64::try_from(ONE).ok()?);
    let whole = |units: i128| Some(Rational::from(i64::try_from(units).ok()?) / &unit);
    let power = Rational::from(power);
    let of_powers = [whole(LN_2)? * &power, whole(LN_2 + 1)? * &power];
    let [less, more] = if power.is_negative() {
        let [less, more] = of_powers;
        [more, less]
    } else {
        of_powers
    };
    Some([
        less + whole(2 * sum - ROUNDING_ERROR)?,
        more + whole(2 * sum + ROUNDING_ERROR)?,
    ])
}

/// Returns the greatest multiple of a billionth that is not above this number. Functions are known
/// only between bounds, so more digits are not worth keeping.
pub fn floor_to_billionth(number: &Rational) -> Rational {
    let billion = Rational::from(1_000_000_000);
    (number * &billion).floor() / billion
}

/// Returns the least multiple of a billionth that is not below this number.
pub fn ceil_to_billionth(number: &Rational) -> Rational {
    let billion = Rational::from(1_000_000_000);
    (number * &billion).ceil() / billion
}

/// Splits a positive number into `m·2^k`, with `m` between 3/4 and 3/2.
fn split_exponent(number: &Rational) -> (Rational, i64) {
    /// Exponents of the powers of two that scale a number to near 1, in descending order.
    const STEPS: [u32; 6] = [32, 16, 8, 4, 2, 1];
    let mut mantissa = number.clone();
    let mut power = 0;
    for step in STEPS {
        let factor = Rational::from(1_i64 << step);
        let (low, high) = (Rational::ONE / &factor, factor.clone());
        while mantissa >= high {
            mantissa = mantissa / &factor;
            power += i64::from(step);
        }
        while mantissa <= low {
            mantissa *= &factor;
            power -= i64::from(step);
        }
    }
    if mantissa > Rational::new(3, 2) {
        return (mantissa / Rational::from(2), power + 1);
    }
    if mantissa < Rational::new(3, 4) {
        return (mantissa * Rational::from(2), power - 1);
    }
    (mantissa, power)
}

/// Converts a number between -4 and 4 to units of 2^-60, rounded down.
fn steps(number: &Rational) -> Option<i64> {
    let unit = Rational::from(i64::try_from(ONE).ok()?);
    (number * &unit).floor().as_small().map(|(steps, _)| steps)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_logarithm_of_the_base_is_enclosed() {
        // 1/0! + 1/1! + … + 1/25!, and an upper bound on the remainder.
        let (mut sum, mut term) = (Rational::ZERO, Rational::ONE);
        for n in 1..=25_i64 {
            sum += &term;
            term = term / Rational::from(n);
        }
        sum += &term;
        let [below, _] = ln(&sum).unwrap();
        let [_, above] = ln(&(sum + term)).unwrap();
        assert!(below < Rational::ONE && Rational::ONE < above);
    }

    proptest! {
        #[test]
        fn logarithms_are_enclosed_closely(numerator in 1..i64::MAX, denominator in 1..i64::MAX) {
            let number = Rational::new(numerator, denominator);
            let [below, above] = ln(&number).unwrap();
            let float = number.to_f64().ln();
            prop_assert!(below < above);
            prop_assert!((&above - &below) < Rational::new(1, 1_000_000_000_000_000));
            prop_assert!((below.to_f64() - float).abs() <= 1e-12 * float.abs().max(1.0));
        }

        #[test]
        fn the_logarithm_of_a_product_is_the_sum(one in 1..1_000_000_i64, other in 1..1_000_000_i64) {
            let of = |number: i64| ln(&Rational::new(number, 1000)).unwrap();
            let ([a, b], [c, d]) = (of(one), of(other));
            let product = Rational::new(one, 1000) * Rational::new(other, 1000);
            let [below, above] = ln(&product).unwrap();
            prop_assert!(below <= b + d && a + c <= above);
        }
    }
}
