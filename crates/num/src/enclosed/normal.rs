//! Powers of e and the normal distribution, between two fractions.

use dashu_int::IBig;
use dashu_int::ops::Abs;

use crate::Rational;

/// How finely something is worked out.
#[derive(Clone, Copy)]
struct Fineness {
    /// The unit of the computation is 2 to minus this.
    bits: usize,
    /// Arguments of the normal distribution are rounded to units of 2 to minus this first, so that
    /// their squares are exact.
    rounded: usize,
    /// Results are told in units of 2 to minus this, one to either side for all that was rounded. Less
    /// than `bits` by at least 95.
    told: usize,
}

/// For what is told by itself.
const QUICK: Fineness = Fineness {
    bits: 160,
    rounded: 40,
    told: 64,
};
/// For what is the difference of two numbers that are almost the same.
const FINE: Fineness = Fineness {
    bits: 224,
    rounded: 80,
    told: 112,
};
/// How many standard deviations from the mean nothing is told any more: there is less than 2^-62
/// beyond.
const FAR: i64 = 9;
/// What is beyond, at most, of the normal distribution or of a power.
const BEYOND: (i64, usize) = (1, 62);
/// `1 / √(2π)`, of which all these digits are right.
const PEAK: &str = "0.3989422804014326779399460599343818684758586311649346576659258296706579258993";

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
    /// Beyond that, there is less than 2^-62.
    const MOST: i64 = 45;
    if *argument > Rational::from(MOST) {
        return [Rational::ZERO, beyond()];
    }
    enclosed(&power(argument, QUICK.bits), QUICK)
}

/// The same in units of 2 to minus `bits`, off by less than 2^30 of these.
fn power(argument: &Rational, bits: usize) -> IBig {
    /// 45 divided by 2 so often is less than a tenth.
    const HALVINGS: usize = 9;
    let one = IBig::ONE << bits;
    let small: IBig = argument.in_units(bits) >> HALVINGS;
    let (mut sum, mut term, mut n) = (one.clone(), one, 1);
    while term != IBig::ZERO {
        // Rounded towards 0, so that the loop ends.
        term = -((term * &small) >> bits) / IBig::from(n);
        sum += &term;
        n += 1;
        if term.clone().abs() <= IBig::ONE {
            break;
        }
    }
    for _ in 0..HALVINGS {
        sum = (&sum * &sum) >> bits;
    }
    sum
}

/// How likely a normally distributed number with mean 0 and standard deviation 1 is at most this:
/// between two numbers some 10^-12 apart.
pub fn normal(at: &Rational) -> [Rational; 2] {
    at_most(at, QUICK)
}

/// How likely that number is between two others, the lesser one first: between two numbers some 10^-24
/// apart, so that something is known of short intervals, too.
pub fn normal_between(ends: [&Rational; 2]) -> [Rational; 2] {
    let [[under, over], [least, most]] = ends.map(|at| at_most(at, FINE));
    [(least - over).max(Rational::ZERO), most - under]
}

/// The distribution.
///
/// `1/2 + φ(z)·(z + z³/3 + z⁵/15 + …)`, all of whose terms have one sign. The sum is less than 2^59,
/// and its roundings, none of which is multiplied by more than that afterwards, stay below 2^76 units
/// of the computation.
fn at_most(at: &Rational, fineness: Fineness) -> [Rational; 2] {
    let far = Rational::from(FAR);
    if *at > far {
        return [Rational::ONE - beyond(), Rational::ONE];
    }
    if *at < -far {
        return [Rational::ZERO, beyond()];
    }
    // The distribution rises: what is below is worked out at a smaller argument.
    let rounded = at.in_units(fineness.rounded);
    let [below, _] = at_units(&rounded, fineness);
    let [_, above] = at_units(&(rounded + IBig::ONE), fineness);
    [below.max(Rational::ZERO), above.min(Rational::ONE)]
}

/// The density of that distribution, between two numbers.
pub fn normal_density(at: &Rational) -> [Rational; 2] {
    let square = at * at / Rational::from(2);
    let [below, above] = exp_of_minus(&square);
    let peak: Rational = PEAK.parse().expect("digits");
    [(below * &peak), above * &peak + beyond()]
}

/// The distribution at so many of the units that arguments are rounded to.
fn at_units(units: &IBig, fineness: Fineness) -> [Rational; 2] {
    let Fineness { bits, rounded, .. } = fineness;
    let size = units.clone().abs();
    let square = &size * &size;
    let half_square = Rational::from_units(square.clone(), 2 * rounded + 1);
    let mut term: IBig = size << (bits - rounded);
    let (mut sum, mut odd) = (IBig::ZERO, 1);
    while term > IBig::ZERO {
        sum += &term;
        odd += 2;
        term = ((term * &square) >> (2 * rounded)) / IBig::from(odd);
    }
    let peak: Rational = PEAK.parse().expect("digits");
    let density = (power(&half_square, bits) * peak.in_units(bits)) >> bits;
    let part = (density * sum) >> bits;
    let half = IBig::ONE << (bits - 1);
    let whole = if *units < IBig::ZERO {
        half - part
    } else {
        half + part
    };
    enclosed(&whole, fineness)
}

/// A number in units of the computation that is off by less than 2^94 of them.
fn enclosed(units: &IBig, fineness: Fineness) -> [Rational; 2] {
    let coarse: IBig = units >> (fineness.bits - fineness.told);
    [-1, 2].map(|more| {
        Rational::from_units(&coarse + IBig::from(more), fineness.told).max(Rational::ZERO)
    })
}

/// What is beyond of what is so far away that it is not worked out.
fn beyond() -> Rational {
    let (units, bits) = BEYOND;
    Rational::from_units(IBig::from(units), bits)
}
