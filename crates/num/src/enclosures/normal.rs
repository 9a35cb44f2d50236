//! Powers of e and the normal distribution, between two fractions.

use dashu_int::IBig;
use dashu_int::ops::Abs;

use crate::Rational;

/// Precision of a computation.
#[derive(Clone, Copy)]
struct WorkingPrecision {
    /// The unit of the computation is 2 to minus this.
    bits: usize,
    /// Arguments of the normal distribution are rounded to units of 2 to minus this first, so that
    /// their squares are exact.
    rounded: usize,
    /// Results are rounded to units of 2 to minus this, and widened by one unit on either side for
    /// all rounding errors. Less than `bits` by at least 95.
    result_bits: usize,
}

/// Precision for single values.
const VALUE_PRECISION: WorkingPrecision = WorkingPrecision {
    bits: 160,
    rounded: 40,
    result_bits: 64,
};
/// Precision for differences of two nearly equal numbers.
const DIFFERENCE_PRECISION: WorkingPrecision = WorkingPrecision {
    bits: 224,
    rounded: 80,
    result_bits: 112,
};
/// Distance from the mean, in standard deviations, beyond which the tail is not computed. Its
/// probability is less than 2^-62.
const TAIL_CUTOFF: i64 = 9;
/// Upper bound on the tail of the normal distribution, or on a power, that is not computed.
const TAIL_BOUND: (i64, usize) = (1, 62);
/// `1 / √(2π)`; all these digits are correct.
const INV_SQRT_2PI: &str =
    "0.3989422804014326779399460599343818684758586311649346576659258296706579258993";

/// Returns bounds on `e^-argument` that are some 10^-19 apart; the argument must not be negative.
///
/// The series of the argument divided by a power of two is squared repeatedly. Every step is off by
/// a few units of 2^-160, and each squaring at most doubles that and adds one.
///
/// ```
/// use elbowroom_num::{Rational, enclosures};
///
/// let [below, above] = enclosures::exp_of_minus(&Rational::ONE);
/// assert!(below < above && above.to_decimal(12) == "0.367879441171");
/// ```
pub fn exp_of_minus(argument: &Rational) -> [Rational; 2] {
    /// Greatest argument that is computed; beyond it, the result is less than 2^-62.
    const MAX_ARGUMENT: i64 = 45;
    if *argument > Rational::from(MAX_ARGUMENT) {
        return [Rational::ZERO, tail_bound()];
    }
    error_bounds(&power(argument, VALUE_PRECISION.bits), VALUE_PRECISION)
}

/// Returns `e^-argument` in units of 2 to minus `bits`, off by less than 2^30 of these.
fn power(argument: &Rational, bits: usize) -> IBig {
    /// Number of halvings after which 45 is less than a tenth.
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

/// Returns bounds, some 10^-12 apart, on the probability that a standard normal variable is at most
/// `at`.
pub fn normal_cdf(at: &Rational) -> [Rational; 2] {
    cdf(at, VALUE_PRECISION)
}

/// Returns bounds, some 10^-24 apart, on the probability that a standard normal variable lies
/// between two numbers, the lesser one first. The precision is high enough for short intervals.
pub fn normal_between(ends: [&Rational; 2]) -> [Rational; 2] {
    let [[under, over], [least, most]] = ends.map(|at| cdf(at, DIFFERENCE_PRECISION));
    [(least - over).max(Rational::ZERO), most - under]
}

/// Returns bounds on the standard normal distribution function at `at`.
///
/// It is `1/2 + φ(z)·(z + z³/3 + z⁵/15 + …)`, and all terms have one sign. The sum is less than
/// 2^59. None of its rounding errors is multiplied by more than that afterwards, so they stay below
/// 2^76 units of the computation.
fn cdf(at: &Rational, fineness: WorkingPrecision) -> [Rational; 2] {
    let far = Rational::from(TAIL_CUTOFF);
    if *at > far {
        return [Rational::ONE - tail_bound(), Rational::ONE];
    }
    if *at < -far {
        return [Rational::ZERO, tail_bound()];
    }
    // The distribution function is monotonic, so the lower bound is computed at a smaller argument.
    let rounded = at.in_units(fineness.rounded);
    let [below, _] = cdf_at_units(&rounded, fineness);
    let [_, above] = cdf_at_units(&(rounded + IBig::ONE), fineness);
    [below.max(Rational::ZERO), above.min(Rational::ONE)]
}

/// Returns bounds on the standard normal density.
pub fn normal_density(at: &Rational) -> [Rational; 2] {
    let square = at * at / Rational::from(2);
    let [below, above] = exp_of_minus(&square);
    let peak: Rational = INV_SQRT_2PI.parse().expect("digits");
    [(below * &peak), above * &peak + tail_bound()]
}

/// Returns bounds on the distribution function at a number of the units that arguments are rounded
/// to.
fn cdf_at_units(units: &IBig, fineness: WorkingPrecision) -> [Rational; 2] {
    let WorkingPrecision { bits, rounded, .. } = fineness;
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
    let peak: Rational = INV_SQRT_2PI.parse().expect("digits");
    let density = (power(&half_square, bits) * peak.in_units(bits)) >> bits;
    let part = (density * sum) >> bits;
    let half = IBig::ONE << (bits - 1);
    let whole = if *units < IBig::ZERO {
        half - part
    } else {
        half + part
    };
    error_bounds(&whole, fineness)
}

/// Returns bounds on a number that is given in units of the computation, and off by less than 2^94
/// of them.
fn error_bounds(units: &IBig, fineness: WorkingPrecision) -> [Rational; 2] {
    let coarse: IBig = units >> (fineness.bits - fineness.result_bits);
    [-1, 2].map(|more| {
        Rational::from_units(&coarse + IBig::from(more), fineness.result_bits).max(Rational::ZERO)
    })
}

/// Returns the bound on tails that are not computed.
fn tail_bound() -> Rational {
    let (units, bits) = TAIL_BOUND;
    Rational::from_units(IBig::from(units), bits)
}
