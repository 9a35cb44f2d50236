//! Bounds as written in files.

use elbowroom_num::Rational;

/// Finite or infinite bound.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Bound {
    NegativeInfinity,
    Finite(Rational),
    Infinity,
}

impl Bound {
    /// Reads a decimal, a fraction or an infinity, exactly.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let text = text.trim();
        let lower = text.to_ascii_lowercase();
        match lower.as_str() {
            "inf" | "+inf" | "infinity" | "+infinity" | "∞" | "+∞" => Some(Self::Infinity),
            "-inf" | "-infinity" | "-∞" => Some(Self::NegativeInfinity),
            _ => text.parse().ok().map(Self::Finite),
        }
    }

    pub(crate) fn finite(self) -> Option<Rational> {
        match self {
            Self::Finite(number) => Some(number),
            Self::NegativeInfinity | Self::Infinity => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Bound;
    use elbowroom_num::Rational;

    #[test]
    fn numbers_are_read_exactly_in_all_the_ways_that_programs_write_them() {
        let finite = |text: &str| Bound::parse(text).and_then(Bound::finite);
        assert_eq!(finite("3."), Some(Rational::from(3)));
        assert_eq!(finite("-0.0"), Some(Rational::ZERO));
        assert_eq!(finite("1e9"), Some(Rational::from(1_000_000_000_i64)));
        assert_eq!(finite("7/2"), Some(Rational::new(7, 2)));
        assert_eq!(Bound::parse("-Infinity"), Some(Bound::NegativeInfinity));
        assert_eq!(Bound::parse(" inf"), Some(Bound::Infinity));
        assert_eq!(Bound::parse("NaN"), None);
        assert_eq!(Bound::parse("1e999999999"), None);
    }
}
