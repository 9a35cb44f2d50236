//! Small pieces of text.

use elbowroom_num::Rational;

pub(super) fn number(value: &Rational) -> String {
    let text = value.abs().to_string();
    let text = match text.split_once('/') {
        Some((numerator, denominator)) => format!("(/ {numerator}.0 {denominator}.0)"),
        None => format!("{text}.0"),
    };
    if value.is_negative() {
        format!("(- {text})")
    } else {
        text
    }
}

pub(super) fn apply(operator: &str, empty: &str, parts: &[String]) -> String {
    match parts {
        [] => empty.to_owned(),
        [part] => part.clone(),
        _ => format!("({operator} {})", parts.join(" ")),
    }
}

pub(super) fn and(parts: &[String]) -> String {
    apply("and", "true", parts)
}

pub(super) fn or(parts: &[String]) -> String {
    apply("or", "false", parts)
}

pub(super) fn sum(parts: &[String]) -> String {
    apply("+", "0.0", parts)
}
