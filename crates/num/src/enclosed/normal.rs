//! Powers of e and the normal distribution, between two fractions.

use dashu_int::IBig;
use dashu_int::ops::Abs;

use crate::Rational;

/// The unit of the computation is 2^-160.
const BITS: usize = 160;
/// Arguments of the normal distribution are rounded to units of 2^-40 first, so that their squares
/// are exact.
const COARSE: usize = 40;
/// Results are told in units of 2^-64, one to either side for all that was rounded.
const TOLD: usize = 64;
/// How many standard deviations from the mean nothing is told any more: there is less than 2^-62
/// beyond.
const FAR: i64 = 9;
/// `1 / √(2π)`, of which all these digits are right.
const PEAK: &str = "0.398942280401432677939946059934381868475858631164934657";

/// `e^-argument`, between two numbers some 10^-19 apart; the argument is not negative.
///
/// The series of the argument divided by a power of two, squared as often. Every step is off by a few
/// units of 2^-160, and each squaring at most doubles that and adds one.
///
/// ```
/// use elbowroom_num::{Rational, enclosed};
///
/// let [below, above] = enclosed::exp_of_minus(&Rational::ONE);
/// assert!(below < above && above.to_decimal(12) == "0.367879441171");
/// ```
pub fn exp_of_minus(argument: &Rational) -> [Rational; 2] {
    /// Beyond that, there is less than 2^-64.
    const MOST: i64 = 45;
    if *argument > Rational::from(MOST) {
        return [Rational::ZERO, told(1)];
    }
    enclosed(&power(argument))
}

/// The same in units of 2^-160, off by less than 2^30 of these.
fn power(argument: &Rational) -> IBig {
    /// 45 divided by 2 so often is less than a tenth.
    const HALVINGS: usize = 9;
    let one = IBig::ONE << BITS;
    let small: IBig = argument.in_units(BITS) >> HALVINGS;
    let (mut sum, mut term, mut n) = (one.clone(), one, 1);
    while term != IBig::ZERO {
        // Rounded towards 0, so that the loop ends.
        term = -((term * &small) >> BITS) / IBig::from(n);
        sum += &term;
        n += 1;
        if term.clone().abs() <= IBig::ONE {
            break;
        }
    }
    for _ in 0..HALVINGS {
        sum = (&sum * &sum) >> BITS;
    }
    sum
}

/// How likely a normally distributed number with mean 0 and standard deviation 1 is at most this:
/// between two numbers some 10^-19 apart.
///
/// `1/2 + φ(z)·(z + z³/3 + z⁵/15 + …)`, all of whose terms have one sign. The sum is less than 2^59,
/// and its roundings, none of which is multiplied by more than that afterwards, stay below 2^76 units
/// of 2^-160.
pub fn normal(at: &Rational) -> [Rational; 2] {
    let far = Rational::from(FAR);
    if *at > far {
        return [Rational::ONE - told(4), Rational::ONE];
    }
    if *at < -far {
        return [Rational::ZERO, told(4)];
    }
    // The distribution rises: what is below is worked out at a smaller argument.
    let coarse = at.in_units(COARSE);
    let [below, _] = at_units(&coarse);
    let [_, above] = at_units(&(coarse + IBig::ONE));
    [below.max(Rational::ZERO), above.min(Rational::ONE)]
}

/// The density of that distribution, between two numbers.
pub fn normal_density(at: &Rational) -> [Rational; 2] {
    let square = at * at / Rational::from(2);
    let [below, above] = exp_of_minus(&square);
    let peak: Rational = PEAK.parse().expect("digits");
    [(below * &peak), above * &peak + told(1)]
}

/// The distribution at so many units of 2^-40.
fn at_units(units: &IBig) -> [Rational; 2] {
    let size = units.clone().abs();
    let square = &size * &size;
    let half_square = Rational::from_units(square.clone(), 2 * COARSE + 1);
    let mut term: IBig = size << (BITS - COARSE);
    let (mut sum, mut odd) = (IBig::ZERO, 1);
    while term > IBig::ZERO {
        sum += &term;
        odd += 2;
        term = ((term * &square) >> (2 * COARSE)) / IBig::from(odd);
    }
    let peak: Rational = PEAK.parse().expect("digits");
    let density = (power(&half_square) * peak.in_units(BITS)) >> BITS;
    let part = (density * sum) >> BITS;
    let half = IBig::ONE << (BITS - 1);
    enclosed(&if *units < IBig::ZERO {
        half - part
    } else {
        half + part
    })
}

/// A number in units of 2^-160 that is off by less than 2^94 of them.
fn enclosed(units: &IBig) -> [Rational; 2] {
    let coarse: IBig = units >> (BITS - TOLD);
    [-1, 2].map(|more| Rational::from_units(&coarse + IBig::from(more), TOLD).max(Rational::ZERO))
}

/// So many units in which results are told.
fn told(units: i64) -> Rational {
    Rational::from_units(IBig::from(units), TOLD)
}
