//! Exact numbers in JSON: `docs/formats/envelope-json.md`.

use elbowroom::num::{End, Rational};
use serde_json::{Value, json};

/// A number as an exact text and, beside it, as the nearest float.
pub(crate) fn number(value: &Rational) -> Value {
    json!({ "exact": value.to_string(), "decimal": value.to_f64() })
}

/// The lower end of an interval; infinity has no decimal.
pub(crate) fn lower(end: &End) -> Value {
    self::end(end, "-inf")
}

/// The upper end of an interval.
pub(crate) fn upper(end: &End) -> Value {
    self::end(end, "inf")
}

fn end(end: &End, infinity: &str) -> Value {
    match end.value() {
        Some(value) => number(value),
        None => json!({ "exact": infinity, "decimal": null }),
    }
}

#[cfg(test)]
mod tests {
    use super::{number, upper};
    use elbowroom::num::{End, Rational};

    #[test]
    fn numbers_are_exact_texts_beside_decimals() {
        assert_eq!(
            number(&Rational::new(1393, 2)).to_string(),
            r#"{"exact":"1393/2","decimal":696.5}"#
        );
        assert_eq!(
            upper(&End::Infinite).to_string(),
            r#"{"exact":"inf","decimal":null}"#
        );
    }
}
