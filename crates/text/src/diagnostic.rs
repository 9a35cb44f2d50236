//! Errors and warnings, with their places in a text.

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::source::{Source, Span};

/// Severity of a finding. An error makes a text unusable, a warning does not.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The text cannot be used.
    Error,
    /// The text can be used nevertheless.
    Warning,
}

impl fmt::Display for Severity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Error => "error",
            Self::Warning => "warning",
        })
    }
}

/// A place in a text, and a remark about it.
#[derive(Clone, PartialEq, Eq)]
pub struct Label {
    /// The text that contains the place.
    pub source: Source,
    /// The place.
    pub span: Span,
    /// The remark; may be empty.
    pub text: String,
}

/// Prints `name:line:column: remark`, since the text itself would fill the screen.
impl fmt::Debug for Label {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.source.position(self.span.start);
        write!(f, "{}:{line}:{column}: {}", self.source.name(), self.text)
    }
}

/// An error or a warning.
///
/// `Debug` prints what `Display` prints: `name:line:column: severity: message; advice`.
#[derive(Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// The severity: an error makes the text unusable.
    pub severity: Severity,
    /// The kind of finding, for programs, if the reader distinguishes kinds.
    pub code: Option<&'static str>,
    /// The message, in lower case.
    pub message: String,
    /// The places. There is at least one: the first is the place itself, others explain it.
    pub labels: Vec<Label>,
    /// The form that was expected, or advice.
    pub advice: Option<String>,
}

impl Diagnostic {
    /// Creates a finding at a place in a text.
    pub fn new(
        severity: Severity,
        source: &Source,
        span: Span,
        message: impl Into<String>,
    ) -> Self {
        let label = Label {
            source: source.clone(),
            span,
            text: String::new(),
        };
        Self {
            severity,
            code: None,
            message: message.into(),
            labels: vec![label],
            advice: None,
        }
    }

    /// Sets the remark for the place itself.
    pub fn label(&mut self, text: impl Into<String>) -> &mut Self {
        self.labels[0].text = text.into();
        self
    }

    /// Sets the expected form, or the advice. An empty text removes it.
    pub fn advise(&mut self, advice: impl Into<String>) -> &mut Self {
        let advice = advice.into();
        self.advice = (!advice.is_empty()).then_some(advice);
        self
    }

    /// Adds "did you mean", if there is a suggestion.
    pub fn suggest(&mut self, name: Option<&str>) -> &mut Self {
        if let Some(name) = name {
            self.advice = Some(format!("did you mean `{name}`?"));
        }
        self
    }

    /// Returns the text of the finding.
    pub fn source(&self) -> &Source {
        &self.labels[0].source
    }

    /// Returns the line, from 1.
    pub fn line(&self) -> usize {
        self.position().0
    }

    /// Returns the column, from 1, in characters.
    pub fn column(&self) -> usize {
        self.position().1
    }

    /// Returns the number of characters that the place spans on its line; 0 if something is missing
    /// there.
    pub fn length(&self) -> usize {
        self.source().length(&self.labels[0].span)
    }

    fn position(&self) -> (usize, usize) {
        self.source().position(self.labels[0].span.start)
    }
}

/// Prints `name:line:column: severity: message; advice`.
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.position();
        let (name, severity) = (self.source().name(), self.severity);
        write!(f, "{name}:{line}:{column}: {severity}: {}", self.message)?;
        match &self.advice {
            Some(advice) => write!(f, "; {advice}"),
            None => Ok(()),
        }
    }
}

impl fmt::Debug for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Findings about a text that cannot be used: at least one error, and the warnings.
///
/// `Debug` prints what `Display` prints, so that `main` may return it.
#[derive(Clone, PartialEq, Eq)]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// Returns a value with warnings, unless there is no value or one of the findings is an error.
    ///
    /// # Errors
    /// Returns all findings. A reader that returns no value must have reported an error.
    pub fn outcome<T>(
        value: Option<T>,
        found: Vec<Diagnostic>,
    ) -> Result<(T, Vec<Diagnostic>), Self> {
        let is_error = |d: &Diagnostic| d.severity == Severity::Error;
        match value {
            Some(value) if !found.iter().any(is_error) => Ok((value, found)),
            _ => Err(Self(found)),
        }
    }

    /// Returns all findings in order of detection.
    pub fn iter(&self) -> impl Iterator<Item = &Diagnostic> {
        self.0.iter()
    }

    /// Returns the errors.
    pub fn errors(&self) -> impl Iterator<Item = &Diagnostic> {
        self.iter().filter(|d| d.severity == Severity::Error)
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(diagnostic: Diagnostic) -> Self {
        Self(vec![diagnostic])
    }
}

impl From<Diagnostics> for Vec<Diagnostic> {
    fn from(diagnostics: Diagnostics) -> Self {
        diagnostics.0
    }
}

/// Prints one line for each finding.
impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, diagnostic) in self.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            write!(f, "{diagnostic}")?;
        }
        Ok(())
    }
}

impl fmt::Debug for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Diagnostics {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn debug_prints_what_display_prints_and_not_the_text() {
        let source = Source::new("f", "a secret");
        let mut found = Diagnostic::new(Severity::Error, &source, 2..8, "this is wrong");
        found.advise("leave it out");
        let found = Diagnostics::from(found);
        assert_eq!(
            format!("{found:?}"),
            "f:1:3: error: this is wrong; leave it out"
        );
        assert_eq!(format!("{found:?}"), found.to_string());
        assert!(!format!("{:?}", found.iter().next()).contains("secret"));
    }
}
