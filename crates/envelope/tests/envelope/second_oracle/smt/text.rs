//! Helpers for SMT-LIB text.

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
    junction("and", ("true", "false"), parts)
}

pub(super) fn or(parts: &[String]) -> String {
    junction("or", ("false", "true"), parts)
}

/// Joins parts; `empty` is the neutral part, and `decided` the absorbing one.
fn junction(operator: &str, (empty, decided): (&str, &str), parts: &[String]) -> String {
    if parts.iter().any(|part| part == decided) {
        return decided.to_owned();
    }
    let parts: Vec<_> = parts
        .iter()
        .filter(|part| *part != empty)
        .cloned()
        .collect();
    apply(operator, empty, &parts)
}

pub(super) fn not(part: &str) -> String {
    match part {
        "true" => "false".to_owned(),
        "false" => "true".to_owned(),
        _ => format!("(not {part})"),
    }
}

pub(super) fn sum(parts: &[String]) -> String {
    apply("+", "0.0", parts)
}
