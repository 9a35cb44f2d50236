//! The exact fraction, with a fast path for small numbers.

mod float;
mod operators;
mod text;

use std::cmp::Ordering;
use std::hash::{Hash, Hasher};

use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;

/// An exact fraction in lowest terms, with a positive denominator.
///
/// A number whose numerator and denominator fit an `i64` is always stored that way, so equal
/// numbers have equal representations.
#[derive(Clone)]
pub struct Rational(Repr);

#[derive(Clone)]
enum Repr {
    /// Numerator and denominator in lowest terms; the numerator is not `i64::MIN`, the denominator
    /// positive.
    Small(i64, i64),
    /// Used only for numbers that do not fit `Small`.
    Big(Box<RBig>),
}

pub use text::ParseRationalError;

use Repr::{Big, Small};

impl Rational {
    /// The number 0.
    pub const ZERO: Self = Self::integer(0);
    /// The number 1.
    pub const ONE: Self = Self::integer(1);

    const fn integer(numerator: i64) -> Self {
        Self(Small(numerator, 1))
    }

    /// Creates the fraction `numerator / denominator`.
    ///
    /// # Panics
    /// If `denominator` is zero.
    pub fn new(numerator: i64, denominator: i64) -> Self {
        assert!(
            denominator != 0,
            "a fraction's denominator must not be zero"
        );
        Self::reduced(i128::from(numerator), i128::from(denominator))
    }

    /// Brings `numerator / denominator` (not zero) to lowest terms.
    pub(crate) fn reduced(numerator: i128, denominator: i128) -> Self {
        debug_assert!(denominator != 0);
        // Divisions of 128 bits cost many times those of 64, and nearly all operands are small.
        if let (Ok(numerator), Ok(denominator)) =
            (i64::try_from(numerator), i64::try_from(denominator))
            && numerator != i64::MIN
            && denominator > 0
        {
            return Self::reduced_small(numerator, denominator);
        }
        let divisor = gcd(numerator.unsigned_abs(), denominator.unsigned_abs());
        // `divisor` is at most the smaller magnitude; it exceeds i128 only for i128::MIN twice.
        let divisor = i128::try_from(divisor).unwrap_or(1);
        let (mut n, mut d) = (numerator / divisor, denominator / divisor);
        if d < 0 {
            (n, d) = (-n, -d);
        }
        match (i64::try_from(n), i64::try_from(d)) {
            (Ok(numerator), Ok(denominator)) if numerator != i64::MIN => {
                Self(Small(numerator, denominator))
            }
            _ => Self::from_big(RBig::from_parts(
                IBig::from(n),
                UBig::try_from(d).expect("the denominator was made positive"),
            )),
        }
    }

    /// Brings `numerator / denominator` to lowest terms; `numerator` is not `i64::MIN` and
    /// `denominator` positive.
    fn reduced_small(numerator: i64, denominator: i64) -> Self {
        let divisor = gcd_u64(numerator.unsigned_abs(), denominator.unsigned_abs());
        let divisor = i64::try_from(divisor).expect("not above the denominator");
        Self(Small(numerator / divisor, denominator / divisor))
    }

    fn from_big(big: RBig) -> Self {
        let (numerator, denominator) = (big.numerator(), big.denominator());
        match (i64::try_from(numerator), i64::try_from(denominator)) {
            (Ok(numerator), Ok(denominator)) if numerator != i64::MIN => {
                Self(Small(numerator, denominator))
            }
            _ => Self(Big(Box::new(big))),
        }
    }

    fn to_big(&self) -> RBig {
        match &self.0 {
            Small(numerator, denominator) => RBig::from_parts(
                IBig::from(*numerator),
                UBig::try_from(*denominator).expect("denominators are positive"),
            ),
            Big(big) => (**big).clone(),
        }
    }

    /// Returns `true` if this is 0.
    pub fn is_zero(&self) -> bool {
        matches!(self.0, Small(0, _))
    }

    /// Returns `true` if this is below 0.
    pub fn is_negative(&self) -> bool {
        self.signum() < 0
    }

    /// Returns `true` if this is above 0.
    pub fn is_positive(&self) -> bool {
        self.signum() > 0
    }

    /// Returns `true` if this is a whole number.
    pub fn is_integer(&self) -> bool {
        match &self.0 {
            Small(_, denominator) => *denominator == 1,
            Big(big) => big.is_int(),
        }
    }

    /// Returns -1, 0 or 1, as this is below, at or above 0.
    pub fn signum(&self) -> i32 {
        match &self.0 {
            Small(numerator, _) => match numerator.cmp(&0) {
                Ordering::Less => -1,
                Ordering::Equal => 0,
                Ordering::Greater => 1,
            },
            Big(big) => {
                if big.numerator() < &IBig::ZERO {
                    -1
                } else {
                    1
                }
            }
        }
    }

    /// Returns the absolute value.
    #[must_use]
    pub fn abs(&self) -> Self {
        if self.is_negative() {
            -self
        } else {
            self.clone()
        }
    }

    /// Returns `1 / self`, or `None` for 0.
    pub fn reciprocal(&self) -> Option<Self> {
        self.checked_div_into(&Self::ONE)
    }

    /// Returns `self / divisor`, or `None` when `divisor` is 0.
    pub fn checked_div(&self, divisor: &Self) -> Option<Self> {
        divisor.checked_div_into(self)
    }

    fn checked_div_into(&self, dividend: &Self) -> Option<Self> {
        if self.is_zero() {
            None
        } else {
            Some(dividend / self)
        }
    }

    /// Returns the largest whole number not above this.
    #[must_use]
    pub fn floor(&self) -> Self {
        match &self.0 {
            Small(numerator, denominator) => Self::from(numerator.div_euclid(*denominator)),
            Big(big) => Self::from_big(RBig::from(big.floor())),
        }
    }

    /// Returns the smallest whole number not below this.
    #[must_use]
    pub fn ceil(&self) -> Self {
        -((-self).floor())
    }

    /// Returns the nearest floating-point number; for display and heuristics only.
    #[allow(
        clippy::cast_precision_loss,
        reason = "that is what this function is for"
    )]
    pub fn to_f64(&self) -> f64 {
        match &self.0 {
            Small(numerator, denominator) => *numerator as f64 / *denominator as f64,
            Big(big) => big.to_f64().value(),
        }
    }

    /// Returns this number in units of `2^-bits`, rounded down.
    pub(crate) fn in_units(&self, bits: usize) -> IBig {
        let unit = RBig::from(IBig::ONE << bits);
        (self.to_big() * unit).floor()
    }

    /// Returns `units` times `2^-bits`.
    pub(crate) fn from_units(units: IBig, bits: usize) -> Self {
        Self::from_big(RBig::from_parts(units, UBig::ONE << bits))
    }

    /// Returns numerator and denominator, when both fit an `i64`.
    pub fn as_small(&self) -> Option<(i64, i64)> {
        match self.0 {
            Small(numerator, denominator) => Some((numerator, denominator)),
            Big(_) => None,
        }
    }

    /// Returns the denominator of the fraction in lowest terms, when it fits an `i64`.
    pub fn denominator(&self) -> Option<i64> {
        match &self.0 {
            Small(_, denominator) => Some(*denominator),
            Big(big) => i64::try_from(big.denominator()).ok(),
        }
    }

    /// Formats the number in decimal notation with at most `digits` digits after the point, rounded
    /// half away from zero, without trailing zeros: `1/3` with 3 digits is `0.333`.
    pub fn to_decimal(&self, digits: u32) -> String {
        if let Small(whole, 1) = &self.0 {
            return whole.to_string();
        }
        let scale = IBig::from(10).pow(digits as usize);
        let magnitude = self.abs().to_big();
        let doubled = RBig::from(scale.clone() * IBig::from(2)) * magnitude + RBig::ONE;
        let rounded = (doubled / RBig::from(2)).floor();
        let whole = (&rounded / &scale).to_string();
        let part = (&rounded % &scale).to_string();
        let mut text = String::new();
        if self.is_negative() && rounded != IBig::ZERO {
            text.push('-');
        }
        text.push_str(&whole);
        let padded = format!("{part:0>width$}", width = digits as usize);
        let trimmed = padded.trim_end_matches('0');
        if digits > 0 && !trimmed.is_empty() {
            text.push('.');
            text.push_str(trimmed);
        }
        text
    }
}

/// Returns the greatest common divisor; `gcd(0, b) = b`.
pub(crate) fn gcd(a: u128, b: u128) -> u128 {
    // Nearly all operands fit 64 bits, where a division is several times cheaper.
    if let (Ok(a), Ok(b)) = (u64::try_from(a), u64::try_from(b)) {
        return u128::from(gcd_u64(a, b));
    }
    let (mut a, mut b) = (a, b);
    while b != 0 {
        if let (Ok(small_a), Ok(small_b)) = (u64::try_from(a), u64::try_from(b)) {
            return u128::from(gcd_u64(small_a, small_b));
        }
        (a, b) = (b, a % b);
    }
    a
}

/// Computes the greatest common divisor by the binary algorithm: shifts and subtractions instead of
/// divisions.
fn gcd_u64(mut a: u64, mut b: u64) -> u64 {
    if a == 0 || b == 0 {
        return a | b;
    }
    let shift = (a | b).trailing_zeros();
    a >>= a.trailing_zeros();
    loop {
        b >>= b.trailing_zeros();
        if a > b {
            std::mem::swap(&mut a, &mut b);
        }
        b -= a;
        if b == 0 {
            return a << shift;
        }
    }
}

impl From<i64> for Rational {
    fn from(value: i64) -> Self {
        if value == i64::MIN {
            Self::reduced(i128::from(value), 1)
        } else {
            Self::integer(value)
        }
    }
}

impl From<i32> for Rational {
    fn from(value: i32) -> Self {
        Self::integer(i64::from(value))
    }
}

impl From<u32> for Rational {
    fn from(value: u32) -> Self {
        Self::integer(i64::from(value))
    }
}

impl Default for Rational {
    fn default() -> Self {
        Self::ZERO
    }
}

impl PartialEq for Rational {
    fn eq(&self, other: &Self) -> bool {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => a == c && b == d,
            (Big(a), Big(b)) => a == b,
            _ => false,
        }
    }
}

impl Eq for Rational {}

impl Hash for Rational {
    fn hash<H: Hasher>(&self, state: &mut H) {
        match &self.0 {
            Small(numerator, denominator) => (numerator, denominator).hash(state),
            Big(big) => (big.numerator(), big.denominator()).hash(state),
        }
    }
}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        match (&self.0, &other.0) {
            (&Small(a, b), &Small(c, d)) => {
                if b == d {
                    a.cmp(&c)
                } else {
                    (i128::from(a) * i128::from(d)).cmp(&(i128::from(c) * i128::from(b)))
                }
            }
            _ => self.to_big().cmp(&other.to_big()),
        }
    }
}

#[cfg(test)]
mod tests;
