//! Exact numbers in documents: as a text, with the nearest float.
//!
//! ```json
//! { "exact": "1393/2", "decimal": 696.5 }
//! ```

use std::fmt::Display;

use elbowroom_num::{End, Rational};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Infinity in documents.
pub const INFINITY: &str = "inf";
/// Minus infinity in documents.
pub const MINUS_INFINITY: &str = "-inf";

/// A number in a document.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exact(pub Rational);

/// The pair as it is read.
#[derive(Deserialize)]
struct Pair {
    exact: String,
    /// For readers without rational arithmetic; ignored when read.
    #[serde(rename = "decimal")]
    _decimal: Option<f64>,
}

/// The pair as it is written, digit by digit, because traces contain very many numbers.
#[derive(Serialize)]
struct Written<T: Display> {
    #[serde(serialize_with = "text")]
    exact: T,
    decimal: Option<f64>,
}

fn text<T: Display, S: Serializer>(exact: &T, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(exact)
}

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serialize(&self.0, serializer)
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserialize(deserializer).map(Self)
    }
}

impl From<Rational> for Exact {
    fn from(number: Rational) -> Self {
        Self(number)
    }
}

/// Writes a number, for `#[serde(with = "…")]`.
///
/// # Errors
/// As the serializer.
pub fn serialize<S: Serializer>(number: &Rational, serializer: S) -> Result<S::Ok, S::Error> {
    let pair = Written {
        exact: number,
        decimal: Some(number.to_f64()),
    };
    pair.serialize(serializer)
}

/// Reads a number, for `#[serde(with = "…")]`.
///
/// # Errors
/// If it is not a number.
pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Rational, D::Error> {
    let pair = Pair::deserialize(deserializer)?;
    pair.exact.parse().map_err(D::Error::custom)
}

/// Numbers that may be absent (`null`).
pub mod option {
    use super::{Deserialize, Deserializer, Exact, Rational, Serialize, Serializer};

    /// Writes the number, or `null`.
    ///
    /// # Errors
    /// As the serializer.
    #[allow(
        clippy::ref_option,
        reason = "this is how serde hands over a field of that type"
    )]
    pub fn serialize<S: Serializer>(
        number: &Option<Rational>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        number.clone().map(Exact).serialize(serializer)
    }

    /// Reads the number, or `null`.
    ///
    /// # Errors
    /// If it is neither.
    pub fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<Rational>, D::Error> {
        let number = Option::<Exact>::deserialize(deserializer)?;
        Ok(number.map(|Exact(number)| number))
    }
}

/// The lower end of an interval; infinity is `"-inf"`, without a decimal.
pub mod lower {
    use super::{Deserializer, End, Serializer};

    /// Writes the end.
    ///
    /// # Errors
    /// As the serializer.
    pub fn serialize<S: Serializer>(end: &End, serializer: S) -> Result<S::Ok, S::Error> {
        super::serialize_end(end, super::MINUS_INFINITY, serializer)
    }

    /// Reads the end.
    ///
    /// # Errors
    /// If it is neither a number nor infinity.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<End, D::Error> {
        super::deserialize_end(super::MINUS_INFINITY, deserializer)
    }
}

/// The upper end of an interval; infinity is `"inf"`, without a decimal.
pub mod upper {
    use super::{Deserializer, End, Serializer};

    /// Writes the end.
    ///
    /// # Errors
    /// As the serializer.
    pub fn serialize<S: Serializer>(end: &End, serializer: S) -> Result<S::Ok, S::Error> {
        super::serialize_end(end, super::INFINITY, serializer)
    }

    /// Reads the end.
    ///
    /// # Errors
    /// If it is neither a number nor infinity.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<End, D::Error> {
        super::deserialize_end(super::INFINITY, deserializer)
    }
}

fn serialize_end<S: Serializer>(
    end: &End,
    infinity: &'static str,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    match end.value() {
        Some(value) => serialize(value, serializer),
        None => infinite(infinity, serializer),
    }
}

/// Writes infinity, which has no decimal.
///
/// # Errors
/// As the serializer.
pub fn infinite<S: Serializer>(infinity: &'static str, serializer: S) -> Result<S::Ok, S::Error> {
    let pair = Written {
        exact: infinity,
        decimal: None,
    };
    pair.serialize(serializer)
}

fn deserialize_end<'de, D: Deserializer<'de>>(
    infinity: &'static str,
    deserializer: D,
) -> Result<End, D::Error> {
    let pair = Pair::deserialize(deserializer)?;
    if pair.exact == infinity {
        return Ok(End::Infinite);
    }
    pair.exact
        .parse()
        .map(End::Closed)
        .map_err(D::Error::custom)
}

#[cfg(test)]
mod tests {
    use elbowroom_num::{End, Rational};
    use serde::{Deserialize, Serialize};

    use super::Exact;

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Ends {
        #[serde(with = "super::lower")]
        lower: End,
        #[serde(with = "super::upper")]
        upper: End,
    }

    #[test]
    fn numbers_have_exact_text_and_decimal() {
        let text = serde_json::to_string(&Exact(Rational::new(1393, 2))).unwrap();
        assert_eq!(text, r#"{"exact":"1393/2","decimal":696.5}"#);
        let read: Exact = serde_json::from_str(r#"{"exact":"1/3","decimal":0.3}"#).unwrap();
        assert_eq!(read, Exact(Rational::new(1, 3)), "the decimal is ignored");
        assert!(serde_json::from_str::<Exact>(r#"{"exact":"a third","decimal":0.3}"#).is_err());
    }

    #[test]
    fn infinite_end_has_sign_without_decimal() {
        let ends = Ends {
            lower: End::Infinite,
            upper: End::Infinite,
        };
        let text = serde_json::to_string(&ends).unwrap();
        assert_eq!(
            text,
            r#"{"lower":{"exact":"-inf","decimal":null},"upper":{"exact":"inf","decimal":null}}"#
        );
        assert_eq!(serde_json::from_str::<Ends>(&text).unwrap(), ends);
        let swapped = text.replace("\"-inf\"", "\"inf\"");
        assert!(serde_json::from_str::<Ends>(&swapped).is_err());
    }
}
