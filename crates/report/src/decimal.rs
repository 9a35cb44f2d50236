//! Exact numbers as short decimals, rounded in a known direction.

use elbowroom_num::Rational;

/// Maximum number of decimal digits.
const DIGITS: u32 = 3;

/// Direction of rounding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rounding {
    /// Towards minus infinity: for upper ends.
    Down,
    /// Towards infinity: for lower ends.
    Up,
}

/// Formats the number with at most three decimal digits, rounded to the nearest.
pub fn nearest(value: &Rational) -> String {
    value.to_decimal(DIGITS)
}

/// Formats the number with at most `digits` decimal digits, rounded in the given direction.
pub fn rounded(value: &Rational, digits: u32, rounding: Rounding) -> String {
    round(value, digits, rounding).to_decimal(digits)
}

/// Formats an end of an interval around `inside`, rounded inwards, or as an exact fraction if
/// rounding would cross `inside`.
pub fn rounded_inwards(end: &Rational, inside: &Rational, rounding: Rounding) -> String {
    let short = round(end, DIGITS, rounding);
    let stays = match rounding {
        Rounding::Up => short <= *inside,
        Rounding::Down => short >= *inside,
    };
    if stays {
        short.to_decimal(DIGITS)
    } else {
        end.to_string()
    }
}

fn round(value: &Rational, digits: u32, rounding: Rounding) -> Rational {
    let scale = Rational::from(10_i64.pow(digits));
    let scaled = value * &scale;
    let whole = match rounding {
        Rounding::Down => scaled.floor(),
        Rounding::Up => scaled.ceil(),
    };
    &whole / &scale
}

#[cfg(test)]
mod tests {
    use super::{Rounding, nearest, rounded, rounded_inwards};
    use elbowroom_num::Rational;

    #[test]
    fn ends_are_rounded_inwards() {
        let third = Rational::new(1, 3);
        assert_eq!(
            rounded_inwards(&third, &Rational::ONE, Rounding::Up),
            "0.334"
        );
        assert_eq!(
            rounded_inwards(&third, &Rational::ZERO, Rounding::Down),
            "0.333"
        );
        assert_eq!(rounded_inwards(&third, &third, Rounding::Up), "1/3");
        assert_eq!(rounded(&Rational::new(-1, 3), 0, Rounding::Down), "-1");
        assert_eq!(nearest(&Rational::new(2, 3)), "0.667");
    }
}
