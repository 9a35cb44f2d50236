//! Errors of experiments.

use elbowroom_text::{Diagnostic, Diagnostics, Severity, Source, Span};

/// Error in an experiment, or in its results.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ExperimentError {
    /// The experiment file is invalid, or one that it names.
    #[error("{0}")]
    Text(Diagnostics),
    /// Another error, with a message for the user.
    #[error("{0}")]
    Other(String),
    /// The results are those of another experiment.
    #[error(
        "these are results of another experiment; expected results of parts that were made from \
         the same files"
    )]
    WrongExperiment,
}

impl ExperimentError {
    pub(crate) fn other(message: impl Into<String>) -> Self {
        Self::Other(message.into())
    }

    /// Creates an error at a place in the file.
    pub(crate) fn at(source: &Source, span: Span, message: impl Into<String>) -> Self {
        let found = Diagnostic::new(Severity::Error, source, span, message);
        Self::Text(found.into())
    }
}
