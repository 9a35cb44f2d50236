//! Collects diagnostics while texts are read.

use crate::feature::Feature;
use crate::source::{FileId, Span};
use elbowroom_text::Source;
use elbowroom_text::nearest;
use elbowroom_text::{Diagnostic, Label, Severity};

/// The limit on mistakes reported: a text with more of them is not PDDL.
const MOST_DIAGNOSTICS: usize = 200;

/// The texts being read, and what was found in them so far.
#[derive(Debug)]
pub(crate) struct Report {
    domain: Source,
    problem: Source,
    diagnostics: Vec<Diagnostic>,
    /// Takes the place of diagnostics beyond the last that is kept.
    surplus: Option<Diagnostic>,
    is_failed: bool,
}

impl Report {
    pub(crate) fn new(domain: &Source, problem: &Source) -> Self {
        Self {
            domain: domain.clone(),
            problem: problem.clone(),
            diagnostics: Vec::new(),
            surplus: None,
            is_failed: false,
        }
    }

    /// Notes a mistake.
    pub(crate) fn error(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.is_failed = true;
        self.add(Severity::Error, span, message.into())
    }

    /// Notes something odd that does not matter.
    pub(crate) fn warning(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.add(Severity::Warning, span, message.into())
    }

    /// Refuses a feature.
    pub(crate) fn unsupported(
        &mut self,
        feature: Feature,
        span: Span,
        message: impl Into<String>,
    ) -> &mut Diagnostic {
        let diagnostic = self.error(span, message);
        diagnostic.code = Some(feature.code());
        diagnostic.label("not supported")
    }

    /// Ignores a feature, which must not affect validity.
    pub(crate) fn ignored(
        &mut self,
        feature: Feature,
        span: Span,
        message: impl Into<String>,
    ) -> &mut Diagnostic {
        let diagnostic = self.warning(span, message);
        diagnostic.code = Some(feature.code());
        diagnostic.label("ignored")
    }

    /// Adds a label to what was noted last.
    pub(crate) fn attach(&mut self, label: Label) {
        let last = self.surplus.as_mut().or(self.diagnostics.last_mut());
        if let Some(last) = last {
            last.labels.push(label);
        }
    }

    /// The candidate most like `name`, unless there are so many diagnostics that none is needed.
    pub(crate) fn nearest<'a>(
        &self,
        name: &str,
        candidates: impl IntoIterator<Item = &'a str>,
    ) -> Option<&'a str> {
        if self.diagnostics.len() < MOST_DIAGNOSTICS {
            nearest(name, candidates)
        } else {
            None
        }
    }

    /// Whether there was an error.
    pub(crate) fn is_failed(&self) -> bool {
        self.is_failed
    }

    pub(crate) fn into_diagnostics(self) -> Vec<Diagnostic> {
        self.diagnostics
    }

    /// A label for another place that explains the mistake.
    pub(crate) fn label(&self, span: Span, text: impl Into<String>) -> Label {
        Label {
            source: self.source(span.file).clone(),
            span: span.start..span.end,
            text: text.into(),
        }
    }

    fn source(&self, file: FileId) -> &Source {
        match file {
            FileId::Domain => &self.domain,
            FileId::Problem => &self.problem,
        }
    }

    fn add(&mut self, severity: Severity, span: Span, message: String) -> &mut Diagnostic {
        let source = self.source(span.file);
        let diagnostic = Diagnostic::new(severity, source, span.start..span.end, message);
        // An error that is not kept must not turn the outcome into a success: the first error
        // is kept even when warnings have used up the room.
        let is_first_error = severity == Severity::Error
            && !self
                .diagnostics
                .iter()
                .any(|d| d.severity == Severity::Error);
        if self.diagnostics.len() < MOST_DIAGNOSTICS || is_first_error {
            self.diagnostics.push(diagnostic);
            self.diagnostics.last_mut().expect("just pushed")
        } else {
            self.surplus.insert(diagnostic)
        }
    }
}
