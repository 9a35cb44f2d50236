//! Text fragments of messages: counts, system errors, quotations of foreign text.

use std::io;

pub use elbowroom::report::console::count_with_noun;

/// Returns the message of an I/O error in lower case, without the error number of the operating system.
pub fn io_error_message(error: &io::Error) -> String {
    let text = error.to_string();
    match text.find(" (os error") {
        Some(at) => text[..at].to_lowercase(),
        None => text,
    }
}

/// Limit on a quotation, in characters.
const MAX_EXCERPT_LENGTH: usize = 200;

/// Returns foreign text for quotation in a message: control characters escaped, at most 200 characters.
pub fn excerpt(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(MAX_EXCERPT_LENGTH).collect();
    let more = if characters.next().is_some() {
        "…"
    } else {
        ""
    };
    format!("{}{more}", escape_control(&start))
}

/// Returns the text with control characters escaped, such as line feeds and cursor movements.
pub fn escape_control(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            escaped.extend(character.escape_debug());
        } else {
            escaped.push(character);
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::{escape_control, excerpt};

    #[test]
    fn foreign_text_cannot_move_the_cursor() {
        assert_eq!(
            escape_control("a\nb\u{1b}[2Jc\u{9b}é"),
            "a\\nb\\u{1b}[2Jc\\u{9b}é"
        );
        assert_eq!(excerpt(&"x".repeat(300)).chars().count(), 201);
        assert_eq!(excerpt("short"), "short");
    }
}
