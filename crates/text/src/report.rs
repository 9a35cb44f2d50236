//! Collection of findings while a text is read.

use crate::diagnostic::{Diagnostic, Diagnostics, Severity};
use crate::source::{Source, Span};
use crate::suggest::nearest;

/// The text being read, and the findings so far.
#[derive(Debug)]
pub struct Report {
    source: Source,
    findings: Vec<Diagnostic>,
    /// Replaces the findings beyond the limit.
    overflow_notice: Option<Diagnostic>,
    is_failed: bool,
}

impl Report {
    /// Maximum number of findings that are kept.
    pub const MAX_FINDINGS: usize = 100;

    /// Creates a report without findings.
    pub fn new(source: &Source) -> Self {
        Self {
            source: source.clone(),
            findings: Vec::new(),
            overflow_notice: None,
            is_failed: false,
        }
    }

    /// Returns the text being read.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Adds an error.
    pub fn error(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.is_failed = true;
        self.add(Severity::Error, span, message.into())
    }

    /// Adds an error with advice, if there is any.
    pub fn mistake(
        &mut self,
        span: impl Into<Span>,
        message: impl Into<String>,
        advice: impl Into<Option<String>>,
    ) {
        self.error(span.into(), message).advice = advice.into();
    }

    /// Adds a warning about a construct that is accepted, but may be a mistake.
    pub fn warning(&mut self, span: Span, message: impl Into<String>) -> &mut Diagnostic {
        self.add(Severity::Warning, span, message.into())
    }

    /// Adds a warning, unless there is already one with this message.
    pub fn warn_once(&mut self, span: Span, message: &str) -> &mut Diagnostic {
        match self.findings.iter().position(|d| d.message == message) {
            Some(position) => &mut self.findings[position],
            None => self.warning(span, message),
        }
    }

    /// Returns the candidate most similar to `name`. Returns `None` once the number of findings has
    /// reached the limit.
    pub fn nearest<'a>(
        &self,
        name: &str,
        candidates: impl IntoIterator<Item = &'a str>,
    ) -> Option<&'a str> {
        if self.findings.len() < Self::MAX_FINDINGS {
            nearest(name, candidates)
        } else {
            None
        }
    }

    /// Returns `true` if there was an error.
    pub fn is_failed(&self) -> bool {
        self.is_failed
    }

    /// Returns the value with the warnings.
    ///
    /// # Errors
    /// Returns all findings, by position, if there was an error. A reader without a value must have
    /// reported an error.
    pub fn finish<T>(mut self, value: Option<T>) -> Result<(T, Vec<Diagnostic>), Diagnostics> {
        self.findings
            .sort_by_key(|found| found.labels[0].span.start);
        Diagnostics::outcome(value, self.findings)
    }

    fn add(&mut self, severity: Severity, span: Span, message: String) -> &mut Diagnostic {
        let diagnostic = Diagnostic::new(severity, &self.source, span, message);
        // An error that is not kept must not turn the result into a success: the first error is
        // kept even if warnings have reached the limit.
        let is_error = |d: &Diagnostic| d.severity == Severity::Error;
        let is_first_error = severity == Severity::Error && !self.findings.iter().any(is_error);
        if self.findings.len() < Self::MAX_FINDINGS || is_first_error {
            self.findings.push(diagnostic);
            self.findings.last_mut().expect("just pushed")
        } else {
            self.overflow_notice.insert(diagnostic)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn findings_come_by_position() {
        let mut report = Report::new(&Source::from("abc"));
        report.error(2..3, "c");
        report.warning(0..1, "a");
        let found = report.finish(Some(())).unwrap_err();
        let columns: Vec<_> = found.iter().map(Diagnostic::column).collect();
        assert_eq!(columns, [1, 3]);
    }

    #[test]
    fn an_error_after_many_warnings_is_an_error() {
        let mut report = Report::new(&Source::from("abc"));
        for _ in 0..2 * Report::MAX_FINDINGS {
            report.warning(0..1, "odd");
        }
        report.error(1..2, "wrong");
        let found = report.finish(Some(())).unwrap_err();
        assert_eq!(found.iter().count(), Report::MAX_FINDINGS + 1);
        assert_eq!(found.errors().count(), 1);
    }

    #[test]
    fn a_warning_is_given_once() {
        let mut report = Report::new(&Source::from("abc"));
        report.warn_once(0..1, "odd");
        report.warn_once(1..2, "odd");
        let ((), warnings) = report.finish(Some(())).unwrap();
        assert_eq!(warnings.len(), 1);
    }
}
