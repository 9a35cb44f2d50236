//! Documents with one changed number.

use elbowroom_num::Rational;
use serde_json::Value;

/// Finds the places of all numbers inside a value, without the decimal forms, which are only for
/// readers.
pub(crate) fn numbers(value: &Value, path: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(members) => {
            for (name, member) in members {
                if name != "decimal" {
                    numbers(member, &format!("{path}/{name}"), found);
                }
            }
        }
        Value::Array(members) => {
            for (index, member) in members.iter().enumerate() {
                numbers(member, &format!("{path}/{index}"), found);
            }
        }
        Value::String(text) if text.parse::<Rational>().is_ok() => found.push(path.to_owned()),
        Value::Number(_) => found.push(path.to_owned()),
        _ => {}
    }
}

/// Returns a slightly different number.
pub(crate) fn changed(value: &Value) -> Value {
    match value {
        Value::String(text) => {
            let number: Rational = text.parse().expect("a number");
            Value::String((number + Rational::new(1, 7)).to_string())
        }
        number => Value::from(number.as_u64().expect("a position") + 1),
    }
}
