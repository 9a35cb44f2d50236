//! Collection of diagnostics while texts are read.

use crate::feature::Feature;
use crate::source::{FileId, Span};
use elbowroom_text::Source;
use elbowroom_text::nearest;
use elbowroom_text::{Diagnostic, Label, Severity};

/// Maximum number of diagnostics: a text with more mistakes is not PDDL.
const MAX_DIAGNOSTICS: usize = 200;

/// The texts being read, and the diagnostics found so far.
#[derive(Debug)]
pub(crate) struct Report {
    domain: Source,
    problem: Source,
    diagnostics: Vec<Diagnostic>,
    /// Replaces the diagnostics beyond the limit.
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

    /// Adds an error.
    pub(crate) fn error(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.is_failed = true;
        self.add(Severity::Error, span, message.into())
    }

    /// Adds a warning about a harmless oddity.
    pub(crate) fn warning(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.add(Severity::Warning, span, message.into())
    }

    /// Reports an unsupported feature as an error.
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

    /// Reports a feature that is ignored because it does not affect validity.
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

    /// Adds a label to the last diagnostic.
    pub(crate) fn attach(&mut self, label: Label) {
        let last = self.surplus.as_mut().or(self.diagnostics.last_mut());
        if let Some(last) = last {
            last.labels.push(label);
        }
    }

    /// Returns the candidate most similar to `name`. Returns `None` once the number of diagnostics
    /// has reached the limit.
    pub(crate) fn nearest<'a>(
        &self,
        name: &str,
        candidates: impl IntoIterator<Item = &'a str>,
    ) -> Option<&'a str> {
        if self.diagnostics.len() < MAX_DIAGNOSTICS {
            nearest(name, candidates)
        } else {
            None
        }
    }

    /// Returns `true` if there was an error.
    pub(crate) fn is_failed(&self) -> bool {
        self.is_failed
    }

    pub(crate) fn into_diagnostics(self) -> Vec<Diagnostic> {
        self.diagnostics
    }

    /// Returns a label for another position that explains the mistake.
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
        // An error that is not kept must not turn the result into a success: the first error is
        // kept even if warnings have reached the limit.
        let is_first_error = severity == Severity::Error
            && !self
                .diagnostics
                .iter()
                .any(|d| d.severity == Severity::Error);
        if self.diagnostics.len() < MAX_DIAGNOSTICS || is_first_error {
            self.diagnostics.push(diagnostic);
            self.diagnostics.last_mut().expect("just pushed")
        } else {
            self.surplus.insert(diagnostic)
        }
    }
}
