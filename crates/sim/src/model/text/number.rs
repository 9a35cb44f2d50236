//! Numbers of world files: TOML numbers, and fractions as texts, such as `"13/3"`.

use elbowroom_num::Rational;
use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;

/// A number of the file.
#[derive(Clone, Debug)]
pub(super) enum Number {
    /// A TOML number.
    Decimal(f64),
    /// A fraction.
    Fraction(Rational),
}

impl Number {
    /// Returns the number exactly as written, or `None` if it is not finite.
    pub(super) fn exact(&self) -> Option<Rational> {
        match self {
            Self::Decimal(value) => Rational::from_f64_as_written(*value),
            Self::Fraction(value) => Some(value.clone()),
        }
    }

    fn to_f64(&self) -> f64 {
        match self {
            Self::Decimal(value) => *value,
            Self::Fraction(value) => value.to_f64(),
        }
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = Number;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a number, or a fraction such as \"13/3\"")
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Number, E> {
        Ok(Number::Decimal(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Number, E> {
        Ok(Number::Fraction(Rational::from(value)))
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Number, E> {
        text.parse()
            .map(Number::Fraction)
            .map_err(|_| E::invalid_value(Unexpected::Str(text), &self))
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor)
    }
}

/// Reads a number for a computation in floating point, with its position.
pub(super) fn optional<'de, D>(deserializer: D) -> Result<Option<Spanned<f64>>, D::Error>
where
    D: Deserializer<'de>,
{
    let number = Spanned::<Number>::deserialize(deserializer)?;
    Ok(Some(Spanned::new(number.span(), number.get_ref().to_f64())))
}

/// Reads a number for a computation in floating point.
pub(super) fn plain<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<f64>, D::Error> {
    Number::deserialize(deserializer).map(|number| Some(number.to_f64()))
}

/// Reads a list of numbers, with its position.
pub(super) fn list<'de, D>(deserializer: D) -> Result<Option<Spanned<Vec<f64>>>, D::Error>
where
    D: Deserializer<'de>,
{
    let numbers = Spanned::<Vec<Number>>::deserialize(deserializer)?;
    let values = numbers.get_ref().iter().map(Number::to_f64).collect();
    Ok(Some(Spanned::new(numbers.span(), values)))
}
