//! Fractions read from text, and written.

use std::fmt;
use std::str::FromStr;

use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;

use super::Rational;
use super::Repr::{Big, Small};

/// A whole number, or `p/q` in lowest terms: exactly what [`FromStr`] reads back.
impl fmt::Display for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Small(numerator, 1) => f.pad(&numerator.to_string()),
            Small(numerator, denominator) => f.pad(&format!("{numerator}/{denominator}")),
            Big(big) => f.pad(&big.to_string()),
        }
    }
}

impl fmt::Debug for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// A text is not a number in decimal notation or a fraction.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a number: write a decimal such as 12.5 or a fraction such as 25/2")]
pub struct ParseRationalError {
    text: String,
}

/// Longest numeral accepted; more digits than any measurement has, few enough to stay fast.
const LONGEST_NUMERAL: usize = 400;
/// Largest decimal exponent accepted, for the same reason.
const LARGEST_EXPONENT: i32 = 400;

/// Reads `12`, `-3.5`, `+.5`, `1e-3` and `p/q` exactly.
impl FromStr for Rational {
    type Err = ParseRationalError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let parsed = match text.split_once('/') {
            Some((numerator, denominator)) => match (decimal(numerator), decimal(denominator)) {
                (Some(numerator), Some(denominator)) => numerator.checked_div(&denominator),
                _ => None,
            },
            None => decimal(text),
        };
        parsed.ok_or_else(|| ParseRationalError {
            text: text.chars().take(60).collect(),
        })
    }
}

/// Reads `[+-] digits [. digits] [e [+-] digits]`.
fn decimal(text: &str) -> Option<Rational> {
    if text.len() > LONGEST_NUMERAL {
        return None;
    }
    let (negative, text) = match text.as_bytes().first()? {
        b'-' => (true, &text[1..]),
        b'+' => (false, &text[1..]),
        _ => (false, text),
    };
    let (mantissa, exponent) = match text.find(['e', 'E']) {
        Some(at) => (&text[..at], text[at + 1..].parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (whole, part) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = format!("{whole}{part}");
    if digits.is_empty() || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    if exponent.abs() > LARGEST_EXPONENT {
        return None;
    }
    let shift = i32::try_from(part.len()).ok()? - exponent;
    let power = shift.unsigned_abs();
    let value = match (digits.parse::<i64>(), 10_i64.checked_pow(power)) {
        (Ok(digits), Some(scale)) if shift >= 0 => Rational::new(digits, scale),
        _ => {
            let digits = IBig::from_str(&digits).ok()?;
            let scale = UBig::from(10_u8).pow(power as usize);
            Rational::from_big(if shift >= 0 {
                RBig::from_parts(digits, scale)
            } else {
                RBig::from(digits * IBig::from(scale))
            })
        }
    };
    Some(if negative { -value } else { value })
}
