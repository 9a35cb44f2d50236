//! Errors of this crate, and warnings during a run.

use std::fmt;
use std::sync::Arc;

/// Failure of an operation, with advice for the user.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Error {
    message: String,
    advice: String,
}

impl Error {
    /// Creates an error. `message` names the object and the problem, in lower case; `advice` says
    /// what the user can do, and may be empty.
    pub fn new(message: impl fmt::Display, advice: impl fmt::Display) -> Self {
        Self {
            message: message.to_string(),
            advice: advice.to_string(),
        }
    }

    /// Returns the error message, in lower case.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Returns the advice for the user; may be empty.
    pub fn advice(&self) -> &str {
        &self.advice
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for Error {}

/// Receiver of warnings that are issued while a run continues. The default ignores them.
#[derive(Clone)]
pub struct WarningSink(Arc<dyn Fn(&str) + Send + Sync>);

impl WarningSink {
    /// Calls `receive` for each warning, from any thread.
    pub fn new(receive: impl Fn(&str) + Send + Sync + 'static) -> Self {
        Self(Arc::new(receive))
    }

    /// Issues a warning.
    pub fn warn(&self, text: &str) {
        (self.0)(text);
    }
}

impl Default for WarningSink {
    fn default() -> Self {
        Self::new(|_| {})
    }
}

impl fmt::Debug for WarningSink {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("WarningSink")
    }
}
