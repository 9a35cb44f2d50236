//! Exact numbers in certificates: texts such as `"7/4"`.

use elbowroom_num::Rational;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A number.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Exact(#[serde(with = "crate::number")] pub Rational);

/// Writes a number, for `#[serde(with = "…")]`.
pub(crate) fn serialize<S: Serializer>(
    number: &Rational,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(number)
}

/// Reads a number, for `#[serde(with = "…")]`.
pub(crate) fn deserialize<'de, D: Deserializer<'de>>(
    deserializer: D,
) -> Result<Rational, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(D::Error::custom)
}
