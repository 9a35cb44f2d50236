//! What was found wrong, or worth a warning, and where.

use std::fmt;
use std::ops::Range;

use crate::feature::Feature;
use crate::render;
use crate::source::Source;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The text cannot be used.
    Error,
    /// The text is used all the same.
    Warning,
}

/// A stretch of a text, and what there is to say about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Label {
    /// The text.
    pub source: Source,
    /// The stretch, in bytes.
    pub range: Range<usize>,
    /// What to say; may be empty.
    pub text: String,
}

/// One mistake, refusal or warning.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is.
    pub severity: Severity,
    /// The feature that is refused or ignored; `None` for a mistake in the text.
    pub feature: Option<Feature>,
    /// What is wrong, in lower case.
    pub message: String,
    /// Where; the first is the place itself, others say more.
    pub labels: Vec<Label>,
    /// What was expected, or what to do.
    pub help: Option<String>,
}

impl Diagnostic {
    pub(crate) fn new(severity: Severity, message: impl Into<String>, label: Label) -> Self {
        Self {
            severity,
            feature: None,
            message: message.into(),
            labels: vec![label],
            help: None,
        }
    }

    pub(crate) fn label(&mut self, text: impl Into<String>) -> &mut Self {
        self.labels[0].text = text.into();
        self
    }

    pub(crate) fn help(&mut self, help: impl Into<String>) -> &mut Self {
        self.help = Some(help.into());
        self
    }

    /// Adds "did you mean", if there is something to suggest.
    pub(crate) fn suggest(&mut self, name: Option<&str>) -> &mut Self {
        if let Some(name) = name {
            self.help = Some(format!("did you mean `{name}`?"));
        }
        self
    }

    /// Whether a feature is refused, rather than a mistake found.
    pub fn is_unsupported(&self) -> bool {
        self.severity == Severity::Error && self.feature.is_some()
    }

    /// The name of the text.
    pub fn source_name(&self) -> &str {
        self.labels[0].source.name()
    }

    /// The line, from 1.
    pub fn line(&self) -> usize {
        self.position().0
    }

    /// The column, from 1, in characters.
    pub fn column(&self) -> usize {
        self.position().1
    }

    fn position(&self) -> (usize, usize) {
        self.labels[0].source.position(self.labels[0].range.start)
    }

    /// The diagnostic with an excerpt of the text, as a terminal shows it.
    pub fn render(&self, colored: bool) -> String {
        render::render(self, colored)
    }
}

/// `name:line:column: error: message`
impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (line, column) = self.position();
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let name = self.source_name();
        write!(f, "{name}:{line}:{column}: {severity}: {}", self.message)
    }
}

/// Why a text cannot be used: at least one error, and the warnings met on the way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostics(Vec<Diagnostic>);

impl Diagnostics {
    /// What was found, as an outcome: `value` with warnings, unless there is an error.
    pub(crate) fn outcome<T>(
        value: Option<T>,
        diagnostics: Vec<Diagnostic>,
    ) -> Result<(T, Vec<Diagnostic>), Self> {
        let is_error = |d: &Diagnostic| d.severity == Severity::Error;
        match value {
            Some(value) if !diagnostics.iter().any(is_error) => Ok((value, diagnostics)),
            _ => Err(Self(diagnostics)),
        }
    }

    /// All of them, in the order in which they were found.
    pub fn iter(&self) -> impl Iterator<Item = &Diagnostic> {
        self.0.iter()
    }

    /// The errors among them.
    pub fn errors(&self) -> impl Iterator<Item = &Diagnostic> {
        self.iter().filter(|d| d.severity == Severity::Error)
    }

    /// Whether the text is right as far as we can tell, and only uses what we do not execute.
    pub fn is_unsupported(&self) -> bool {
        self.errors().all(Diagnostic::is_unsupported)
    }

    /// All of them with excerpts, as a terminal shows them.
    pub fn render(&self, colored: bool) -> String {
        self.iter()
            .map(|diagnostic| diagnostic.render(colored))
            .collect::<Vec<_>>()
            .join("\n\n")
    }
}

impl From<Diagnostics> for Vec<Diagnostic> {
    fn from(diagnostics: Diagnostics) -> Self {
        diagnostics.0
    }
}

/// One line each.
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

impl std::error::Error for Diagnostics {}
