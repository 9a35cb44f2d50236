//! Standard output and standard error.

use std::cell::{Cell, RefCell};
use std::io::{self, ErrorKind, Write};
use std::path::Path;

use elbowroom::text::{Diagnostic, Record};
use serde::Serialize;
use serde_json::Value;

use crate::exit::Failure;

/// Writes text to standard output. Escape sequences are dropped where colours are not wanted.
///
/// When the reader has gone (`| head`) the rest is dropped silently, as it asked for.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = anstream::stdout().lock();
    let written = stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush());
    survive(written, "standard output")
}

thread_local! {
    /// The warnings that were printed, for the document that `--json` asks for.
    static WARNINGS: RefCell<Vec<Record>> = const { RefCell::new(Vec::new()) };
    /// Whether standard output has its document.
    static HAS_DOCUMENT: Cell<bool> = const { Cell::new(false) };
}

/// Writes one JSON document to standard output, with the warnings that were printed before.
pub(crate) fn print_json(document: &Value) -> Result<(), Failure> {
    let warnings = WARNINGS.take();
    HAS_DOCUMENT.set(true);
    if let (Value::Object(members), false) = (document, warnings.is_empty())
        && !members.contains_key(DIAGNOSTICS)
    {
        let mut members = members.clone();
        let warnings = serde_json::to_value(warnings).unwrap_or_default();
        members.insert(DIAGNOSTICS.to_owned(), warnings);
        return print(&format!("{:#}\n", Value::Object(members)));
    }
    print(&format!("{document:#}\n"))
}

/// The member of documents that lists warnings, and what is wrong in a text.
const DIAGNOSTICS: &str = "diagnostics";

/// Writes an answer to standard output, as one JSON document.
pub(crate) fn print_document(answer: &impl Serialize) -> Result<(), Failure> {
    let document = serde_json::to_value(answer)
        .map_err(|error| Failure::new(format!("cannot write the answer as JSON: {error}"), ""))?;
    print_json(&document)
}

/// Writes why there is no answer to standard error and, if a program is to read it and there is no
/// document yet, as one to standard output.
pub(crate) fn fail(failure: &Failure, as_json: bool) {
    tell(&failure.to_string());
    if as_json && !HAS_DOCUMENT.get() {
        // That standard output cannot be written to is told by the exit code.
        let _ = print_document(&failure.document());
    }
}

/// Writes a warning about a text to standard error.
pub(crate) fn warn_about(warning: &Diagnostic) {
    tell(&format!("{}\n", warning.render(true)));
    WARNINGS.with_borrow_mut(|warnings| warnings.push(warning.record()));
}

/// Writes text to standard error. There is nobody to tell when that fails.
pub(crate) fn tell(text: &str) {
    let mut stderr = anstream::stderr().lock();
    let _ = writeln!(stderr, "{text}");
}

/// Writes a warning to standard error.
pub(crate) fn warn(text: &str) {
    let label = crate::look::styled(crate::look::WARNING, "warning");
    tell(&format!("{label}: {text}"));
}

/// Writes a file; `-` is standard output.
pub(crate) fn write_file(path: &Path, text: &str) -> Result<(), Failure> {
    if path.as_os_str() == "-" {
        return print(text);
    }
    std::fs::write(path, text).map_err(|error| {
        Failure::new(
            format!("cannot write {}: {}", path.display(), plain(&error)),
            "choose a file in a folder that exists and that you may write to",
        )
    })
}

fn survive(result: io::Result<()>, target: &str) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::new(
            format!("cannot write to {target}: {}", plain(&error)),
            "",
        )),
        _ => Ok(()),
    }
}

/// `1 check`, `2 checks`.
pub(crate) fn counted(count: usize, what: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {what}{plural}")
}

/// The error without the number that the operating system gives it.
pub(crate) fn plain(error: &io::Error) -> String {
    let text = error.to_string();
    match text.find(" (os error") {
        Some(at) => text[..at].to_lowercase(),
        None => text,
    }
}

/// Longer quotations do not help anybody.
const LONGEST_EXCERPT: usize = 200;

/// Foreign text to quote in a message: without control characters, and not too long.
pub(crate) fn excerpt(text: &str) -> String {
    let mut characters = text.chars();
    let start: String = characters.by_ref().take(LONGEST_EXCERPT).collect();
    let more = if characters.next().is_some() {
        "…"
    } else {
        ""
    };
    format!("{}{more}", tame(&start))
}

/// The text with control characters, such as line feeds and those that move the cursor, written
/// out.
pub(crate) fn tame(text: &str) -> String {
    let mut tamed = String::with_capacity(text.len());
    for character in text.chars() {
        if character.is_control() {
            tamed.extend(character.escape_debug());
        } else {
            tamed.push(character);
        }
    }
    tamed
}

#[cfg(test)]
mod tests {
    use super::{excerpt, tame};

    #[test]
    fn foreign_text_cannot_move_the_cursor() {
        assert_eq!(tame("a\nb\u{1b}[2Jc\u{9b}é"), "a\\nb\\u{1b}[2Jc\\u{9b}é");
        assert_eq!(excerpt(&"x".repeat(300)).chars().count(), 201);
        assert_eq!(excerpt("short"), "short");
    }
}
