//! Exact numbers in JSON: `docs/formats/envelope-json.md`.

use elbowroom::answers::Exact;
use elbowroom::num::Rational;
use serde_json::{Value, json};

/// A number as an exact text and, beside it, as the nearest float.
pub(crate) fn number(value: &Rational) -> Value {
    json!(Exact(value.clone()))
}
