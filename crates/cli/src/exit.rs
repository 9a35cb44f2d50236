//! Exit codes and failures of the command: `docs/reference/exit-codes.md`.

use std::fmt::{self, Write as _};

use elbowroom::text::{Diagnostics, Record};
use serde::Serialize;

use elbowroom_executive::messages::count_with_noun;

/// The meaning of an exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// The answer is yes, or the command has succeeded.
    Yes = 0,
    /// The answer is no.
    No = 1,
    /// The input or the command line is wrong.
    BadInput = 2,
    /// A limit was reached without a result.
    Limit = 3,
    /// A bug of this program.
    Bug = 70,
    /// The run was stopped on request before it was over.
    Interrupted = 130,
}

/// Reason why there is no answer: the input is wrong, or the environment failed.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Failure {
    /// The error message, in lower case.
    message: String,
    /// Advice: what the user can do about it.
    advice: Option<String>,
    /// Errors in input texts, with their positions.
    diagnostics: Vec<Record>,
    /// The message as a terminal shows it.
    #[serde(skip)]
    text: String,
}

/// Result of a command whose answer is already printed, or its failure.
pub(crate) type Answer = Result<Exit, Failure>;

/// A failure as a document: `docs/reference/formats/diagnostics.md`.
#[derive(Serialize)]
pub(crate) struct FailureDocument<'a> {
    format: &'static str,
    version: u32,
    #[serde(flatten)]
    failure: &'a Failure,
}

impl Failure {
    /// Creates a failure with advice.
    pub(crate) fn new(message: impl fmt::Display, advice: impl fmt::Display) -> Self {
        let (message, advice) = (message.to_string(), advice.to_string());
        let label = crate::terminal::styled(crate::terminal::ERROR, "error");
        let mut text = format!("{label}: {message}");
        if !advice.is_empty() {
            let label = crate::terminal::styled(crate::terminal::HINT, "help");
            let _ = write!(text, "\n  {label}: {advice}");
        }
        Self {
            message,
            advice: (!advice.is_empty()).then_some(advice),
            diagnostics: Vec::new(),
            text,
        }
    }

    /// Returns the error message, in lower case.
    pub(crate) fn message(&self) -> &str {
        &self.message
    }

    /// Returns the first error of a text with its position, or else the message.
    pub(crate) fn sentence(&self) -> String {
        match self.diagnostics.first() {
            Some(first) => {
                let (file, line, column) = (&first.file, first.line, first.column);
                format!("{file}:{line}:{column}: {}", first.message)
            }
            None => self.message.clone(),
        }
    }

    /// Returns the advice for the first error of a text, or else the general advice.
    pub(crate) fn advice(&self) -> Option<&str> {
        let first = self.diagnostics.first();
        let own = first.and_then(|first| first.advice.as_deref());
        own.or(self.advice.as_deref())
    }

    /// Returns the errors in input texts.
    pub(crate) fn diagnostics(&self) -> &[Record] {
        &self.diagnostics
    }

    /// Adds advice if the failure has none.
    pub(crate) fn with_default_advice(mut self, advice: &str) -> Self {
        if self.advice.is_none() {
            let label = crate::terminal::styled(crate::terminal::HINT, "help");
            let _ = write!(self.text, "\n  {label}: {advice}");
            self.advice = Some(advice.to_owned());
        }
        self
    }

    /// Returns the document that `--json` prints.
    pub(crate) fn document(&self) -> FailureDocument<'_> {
        FailureDocument {
            format: "elbowroom-failure",
            version: 1,
            failure: self,
        }
    }
}

impl From<elbowroom_executive::Error> for Failure {
    fn from(error: elbowroom_executive::Error) -> Self {
        Self::new(error.message(), error.advice())
    }
}

/// Converts errors in a text to a failure.
impl From<Diagnostics> for Failure {
    fn from(diagnostics: Diagnostics) -> Self {
        let count = count_with_noun(diagnostics.errors().count(), "error");
        Self {
            message: count.clone(),
            advice: None,
            diagnostics: diagnostics.records(),
            text: format!("{}\n\n{count}", diagnostics.render(true)),
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
