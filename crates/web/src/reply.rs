//! Replies and failures.

use std::fmt::Display;

use elbowroom::text::{Diagnostic, Diagnostics, Record};
use serde::Serialize;
use serde_json::{Value, json};

/// The reply to a question.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Reply {
    /// Exit code of the command: `docs/reference/exit-codes.md`.
    pub exit: u8,
    /// The document that the command prints with `--json`; empty for a page.
    pub document: String,
    /// The trace of a run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trace: Option<String>,
    /// The network of a plan as an STN plan file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stn: Option<String>,
    /// A page: an HTML file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub page: Option<String>,
}

/// Reason why there is no answer.
#[derive(Clone, Debug)]
pub(crate) struct Failure {
    message: String,
    diagnostics: Vec<Record>,
}

impl Failure {
    pub(crate) fn new(message: impl Display) -> Self {
        Self {
            message: message.to_string(),
            diagnostics: Vec::new(),
        }
    }
}

/// A text cannot be used.
impl From<Diagnostics> for Failure {
    fn from(diagnostics: Diagnostics) -> Self {
        let count = diagnostics.errors().count();
        let plural = if count == 1 { "" } else { "s" };
        Self {
            message: format!("{count} error{plural}"),
            diagnostics: diagnostics.records(),
        }
    }
}

impl From<Failure> for Reply {
    fn from(failure: Failure) -> Self {
        let document = json!({
            "format": "elbowroom-failure",
            "version": 1,
            "message": failure.message,
            "advice": null,
            "diagnostics": failure.diagnostics,
        });
        Self {
            exit: 2,
            document: printed(&document),
            ..Self::default()
        }
    }
}

/// Formats an answer like the command, with the warnings about its input texts.
pub(crate) fn document(
    answer: &impl Serialize,
    warnings: &[Diagnostic],
) -> Result<String, Failure> {
    let unwritten = |error| Failure::new(format!("cannot write the answer as JSON: {error}"));
    let mut document = serde_json::to_value(answer).map_err(unwritten)?;
    if let (Value::Object(members), false) = (&mut document, warnings.is_empty()) {
        let records: Vec<Record> = warnings.iter().map(Diagnostic::record).collect();
        let records = serde_json::to_value(records).map_err(unwritten)?;
        members.insert("diagnostics".to_owned(), records);
    }
    Ok(printed(&document))
}

fn printed(document: &Value) -> String {
    format!("{document:#}\n")
}
