//! How the command ends: `docs/exit-codes.md`.

use std::fmt::{self, Write as _};
use std::process::ExitCode;

/// The meaning of an exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// The answer is yes, or what was asked for is done.
    Yes = 0,
    /// The answer is no.
    No = 1,
    /// The input or the command line is wrong.
    BadInput = 2,
    /// A limit was reached with nothing to show.
    Limit = 3,
    /// A mistake in this program.
    Bug = 70,
    /// Somebody asked the run to end before it was over.
    Interrupted = 130,
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        Self::from(exit as u8)
    }
}

/// Why there is no answer: the input cannot be understood, or the outside world failed.
///
/// What it says goes to standard error as it stands, so it brings its own `error: `.
#[derive(Debug)]
pub(crate) struct Failure(String);

/// The answer to a command, already printed; or why there is none.
pub(crate) type Answer = Result<Exit, Failure>;

impl Failure {
    /// A failure with what to do about it.
    pub(crate) fn new(message: impl fmt::Display, help: impl fmt::Display) -> Self {
        let help = help.to_string();
        let mut text = format!(
            "{}: {message}",
            crate::look::styled(crate::look::BAD, "error")
        );
        if !help.is_empty() {
            let label = crate::look::styled(crate::look::HINT, "help");
            let _ = write!(text, "\n  {label}: {help}");
        }
        Self(text)
    }

    /// A failure that says everything itself.
    pub(crate) fn rendered(text: String) -> Self {
        Self(text)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}
