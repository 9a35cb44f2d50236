//! Reader of TOML files that reports mistakes as diagnostics.

use serde::de::DeserializeOwned;

use crate::diagnostic::{Diagnostic, Severity};
use crate::source::Source;
use crate::suggest::nearest;

/// Reads a TOML file into a type.
///
/// # Errors
/// Returns the first mistake, at the wrong key or value. The message mentions no Rust types, and
/// suggests the key that was probably meant.
pub fn read<T: DeserializeOwned>(source: &Source) -> Result<T, Diagnostic> {
    toml::from_str(source.text()).map_err(|error| diagnostic(source, &error))
}

/// Converts an error of the TOML reader to a diagnostic.
pub fn diagnostic(source: &Source, error: &toml::de::Error) -> Diagnostic {
    let end = source.text().trim_end().len();
    let span = error.span().unwrap_or(end..end);
    let message = error.message().trim().replace('\n', "; ");
    let (message, advice) = if let Some((unknown, known)) = unknown(&message) {
        let near = nearest(unknown, known.iter().copied());
        let advice = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None if known.is_empty() => "leave it out".to_owned(),
            None => format!("known here: {}", known.join(", ")),
        };
        let kind = if message.starts_with("unknown variant") {
            "value"
        } else {
            "key"
        };
        (format!("unknown {kind} `{unknown}`"), advice)
    } else if let Some(key) = quoted_after(&message, "missing field ") {
        (format!("`{key}` is missing"), format!("add `{key} = …`"))
    } else {
        (plain_message(&message), String::new())
    };
    let mut diagnostic = Diagnostic::new(Severity::Error, source, span, message);
    diagnostic.advise(advice);
    diagnostic
}

/// Returns the unknown name and the known ones of a message: "unknown field `a`, expected one of
/// `b`, `c`".
fn unknown(message: &str) -> Option<(&str, Vec<&str>)> {
    let start = ["unknown field ", "unknown variant "]
        .into_iter()
        .find(|start| message.starts_with(start))?;
    let name = quoted_after(message, start)?;
    let (_, known) = message.split_once("expected ").unwrap_or_default();
    Some((name, known.split('`').skip(1).step_by(2).collect()))
}

/// Returns the name in backquotes that follows `start` at the beginning of the message.
fn quoted_after<'m>(message: &'m str, start: &str) -> Option<&'m str> {
    message
        .strip_prefix(start)?
        .strip_prefix('`')?
        .split('`')
        .next()
}

/// Converts the message of the TOML reader, which mentions Rust types, to plain words.
fn plain_message(message: &str) -> String {
    const FOUND: [(&str, &str); 5] = [
        ("floating point `", "the number `"),
        ("integer `", "the number `"),
        ("boolean `", "the truth value `"),
        ("sequence", "a list"),
        ("map", "a table"),
    ];
    const EXPECTED: [(&str, &str); 9] = [
        ("f", "a number"),
        ("i", "a whole number"),
        ("u", "a whole number that is not negative"),
        ("a sequence", "a list"),
        ("a boolean", "true or false"),
        ("a string", "a text in quotes"),
        ("struct ", "a table"),
        ("a map", "a table"),
        ("a tuple ", "a list"),
    ];
    let Some((found, expected)) = message.split_once(", expected ") else {
        return message.to_owned();
    };
    let found = found
        .strip_prefix("invalid type: ")
        .or(found.strip_prefix("invalid value: "));
    let Some(found) = found else {
        return message.to_owned();
    };
    let found = match FOUND.iter().find(|(rust, _)| found.starts_with(rust)) {
        Some((rust, word)) => found.replacen(rust, word, 1),
        None => found.replacen("string \"", "the text \"", 1),
    };
    let is_number = expected.ends_with(|c: char| c.is_ascii_digit()) || expected.ends_with("size");
    let expected = EXPECTED
        .iter()
        .find(|(rust, _)| expected.starts_with(rust) && (rust.len() > 1 || is_number))
        .map_or(expected, |(_, word)| word);
    format!("found {found}, expected {expected}")
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[allow(dead_code, reason = "the parsed value is not used")]
    struct File {
        seed: u64,
        #[serde(default)]
        action: Option<String>,
        #[serde(default)]
        share: Option<f64>,
        #[serde(default)]
        names: Vec<String>,
        #[serde(default)]
        is_new: Option<bool>,
        #[serde(default)]
        colour: Option<Colour>,
    }

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Colour {
        Red,
        Green,
    }

    fn wrong(text: &str) -> String {
        read::<File>(&Source::new("f", text))
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn misspelt_key_suggests_known_key() {
        insta::assert_snapshot!(wrong("seed = 1\nactoin = \"a\""), @"f:2:1: error: unknown key `actoin`; did you mean `action`?");
        insta::assert_snapshot!(wrong("seed = 1\nwhatever = 3"), @"f:2:1: error: unknown key `whatever`; known here: seed, action, share, names, is_new, colour");
        insta::assert_snapshot!(wrong("seed = 1\ncolour = \"gren\""), @"f:2:10: error: unknown value `gren`; did you mean `green`?");
    }

    #[test]
    fn message_names_no_rust_type() {
        insta::assert_snapshot!(wrong("seed = \"one\""), @r#"f:1:8: error: found the text "one", expected a whole number that is not negative"#);
        insta::assert_snapshot!(wrong("seed = 1.5"), @"f:1:8: error: found the number `1.5`, expected a whole number that is not negative");
        insta::assert_snapshot!(wrong("seed = 1\nshare = \"half\""), @r#"f:2:9: error: found the text "half", expected a number"#);
        insta::assert_snapshot!(wrong("seed = 1\nnames = 3"), @"f:2:9: error: found the number `3`, expected a list");
        insta::assert_snapshot!(wrong("seed = 1\nis_new = 3"), @"f:2:10: error: found the number `3`, expected true or false");
        insta::assert_snapshot!(wrong("seed = 1\naction = 3"), @"f:2:10: error: found the number `3`, expected a text in quotes");
        insta::assert_snapshot!(wrong("action = \"a\""), @"f:1:1: error: `seed` is missing; add `seed = …`");
        insta::assert_snapshot!(wrong("seed = -1"), @"f:1:8: error: found the number `-1`, expected a whole number that is not negative");
    }

    #[test]
    fn a_mistake_of_the_syntax_has_its_place() {
        insta::assert_snapshot!(wrong("seed = 1\naction = \"a"), @r#"f:2:12: error: invalid basic string, expected `"`"#);
        insta::assert_snapshot!(wrong("seed = 1\nseed = 2"), @"f:2:1: error: duplicate key");
    }
}
