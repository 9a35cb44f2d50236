//! Standard output and standard error.

use std::io::{self, ErrorKind, Write};
use std::path::Path;

use elbowroom::text::{Diagnostic, Record};
use serde::Serialize;
use serde_json::Value;

use crate::exit::Failure;
use elbowroom_executive::WarningSink;
use elbowroom_executive::messages::io_error_message;

/// Writes text to standard output. Escape sequences are removed if colours are not supported.
///
/// If the reader has closed the pipe (`| head`), the rest is discarded silently.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut stdout = anstream::stdout().lock();
    let written = stdout
        .write_all(text.as_bytes())
        .and_then(|()| stdout.flush());
    check_written(written, "standard output")
}

/// State of a command's output, for the document that `--json` requests.
#[derive(Debug, Default)]
pub(crate) struct Output {
    /// The warnings that were printed.
    warnings: Vec<Record>,
    /// `true` if a document was written to standard output.
    has_document: bool,
}

/// Member of documents that lists warnings and errors in input texts.
const DIAGNOSTICS: &str = "diagnostics";

impl Output {
    /// Writes one JSON document to standard output, with the warnings that were printed before.
    pub(crate) fn json(&mut self, document: &Value) -> Result<(), Failure> {
        let warnings = std::mem::take(&mut self.warnings);
        self.has_document = true;
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

    /// Writes an answer to standard output, as one JSON document.
    pub(crate) fn document(&mut self, answer: &impl Serialize) -> Result<(), Failure> {
        let document = serde_json::to_value(answer).map_err(|error| {
            Failure::new(format!("cannot write the answer as JSON: {error}"), "")
        })?;
        self.json(&document)
    }

    /// Writes a failure to standard error. With `as_json`, also writes it to standard output as a
    /// document, unless there is already one.
    pub(crate) fn fail(&mut self, failure: &Failure, as_json: bool) {
        print_to_stderr(&failure.to_string());
        if as_json && !self.has_document {
            // If standard output cannot be written to, the exit code reports it.
            let _ = self.document(&failure.document());
        }
    }

    /// Returns the printed warnings that are not part of a document yet.
    pub(crate) fn warnings(&self) -> &[Record] {
        &self.warnings
    }

    /// Writes warnings about texts to standard error.
    pub(crate) fn warn_about(&mut self, warnings: &[Diagnostic]) {
        for warning in warnings {
            print_to_stderr(&format!("{}\n", warning.render(true)));
            self.warnings.push(warning.record());
        }
    }
}

/// Writes text to standard error. A failure to write it is ignored, as there is no other channel.
pub(crate) fn print_to_stderr(text: &str) {
    let mut stderr = anstream::stderr().lock();
    let _ = writeln!(stderr, "{text}");
}

/// Writes a warning to standard error.
pub(crate) fn warn(text: &str) {
    let label = crate::terminal::styled(crate::terminal::WARNING, "warning");
    print_to_stderr(&format!("{label}: {text}"));
}

/// Writes a file; `-` is standard output.
pub(crate) fn write_file(path: &Path, text: &str) -> Result<(), Failure> {
    if path.as_os_str() == "-" {
        return print(text);
    }
    write_bytes(path, text.as_bytes())
}

/// Writes a binary file; `-` is standard output.
pub(crate) fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if path.as_os_str() == "-" {
        let mut stdout = io::stdout().lock();
        let written = stdout.write_all(bytes).and_then(|()| stdout.flush());
        return check_written(written, "standard output");
    }
    std::fs::write(path, bytes).map_err(|error| {
        Failure::new(
            format!(
                "cannot write {}: {}",
                path.display(),
                io_error_message(&error)
            ),
            "choose a file in an existing, writable folder",
        )
    })
}

fn check_written(result: io::Result<()>, target: &str) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(Failure::new(
            format!("cannot write to {target}: {}", io_error_message(&error)),
            "",
        )),
        _ => Ok(()),
    }
}

/// Returns the receiver of an executive's warnings, which writes them to standard error.
pub(crate) fn warnings() -> WarningSink {
    WarningSink::new(warn)
}
