//! Parsing and formatting of fractions.

use std::fmt;
use std::str::FromStr;

use dashu_int::ops::BitTest;
use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;

use super::Rational;
use super::Repr::{Big, Small};

/// A whole number, or `p/q` in lowest terms: exactly what [`FromStr`] reads back.
impl fmt::Display for Rational {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let is_plain = f.width().is_none() && f.precision().is_none();
        match &self.0 {
            Small(numerator, 1) if is_plain => write!(f, "{numerator}"),
            Small(numerator, denominator) if is_plain => write!(f, "{numerator}/{denominator}"),
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

/// Error for a text that is not a number in decimal notation or a fraction, or that is too long.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParseRationalError {
    /// The beginning of the text.
    text: String,
    is_too_long: bool,
}

impl fmt::Display for ParseRationalError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let text = &self.text;
        if self.is_too_long {
            write!(
                f,
                "`{text}` has too many digits: write at most {LONGEST_NUMERAL} characters, for a number \
                 that has fewer than {LONGEST_NUMERAL} digits when written out"
            )
        } else {
            write!(
                f,
                "`{text}` is not a number: write a decimal such as 12.5 or a fraction such as 25/2"
            )
        }
    }
}

impl std::error::Error for ParseRationalError {}

/// Longest numeral accepted: more digits than any measurement has, and few enough to stay fast.
const LONGEST_NUMERAL: usize = 400;
/// Largest decimal exponent accepted, for the same reason.
const LARGEST_EXPONENT: i32 = 400;
/// Limit on the bits of numerator and denominator. It ensures that a number that was parsed and
/// written as a fraction with its sign is no longer than [`LONGEST_NUMERAL`] on either side, and
/// can be parsed again.
const MAX_BITS: usize = 1_325;

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
        let is_too_long = parsed.is_some() || text.len() > LONGEST_NUMERAL;
        let parsed = parsed.filter(has_few_digits);
        parsed.ok_or_else(|| ParseRationalError {
            text: text.chars().take(60).collect(),
            is_too_long,
        })
    }
}

/// Returns `true` if the written number is short enough to be parsed again.
fn has_few_digits(number: &Rational) -> bool {
    match &number.0 {
        Small(..) => true,
        Big(big) => {
            big.numerator().bit_len() <= MAX_BITS && big.denominator().bit_len() <= MAX_BITS
        }
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn parsed_numbers_round_trip(
            digits in "-?[0-9]{1,420}",
            part in "[0-9]{0,12}",
            exponent in -420..420_i32,
            denominator in "[0-9]{0,30}",
            below in -420..420_i32,
        ) {
            let number = format!("{digits}.{part}e{exponent}");
            let fraction = format!("{number}/{denominator}e{below}");
            for text in [number, fraction] {
                if let Ok(number) = text.parse::<Rational>() {
                    prop_assert_eq!(number.to_string().parse::<Rational>(), Ok(number));
                }
            }
        }
    }

    #[test]
    fn a_number_with_too_many_digits_is_refused_with_the_reason() {
        for text in ["1e400".to_owned(), "1e-400".to_owned(), "7".repeat(401)] {
            let error = text.parse::<Rational>().expect_err("too long").to_string();
            assert!(error.contains("too many digits"), "{error}");
        }
        assert!("1e398".parse::<Rational>().is_ok());
        assert!("9".repeat(398).parse::<Rational>().is_ok());
    }
}
