//! Mistakes in likelihood files, by position.

use std::ops::Range;

/// One mistake in a file of likelihoods.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct LikelihoodError {
    /// Line, from 1.
    pub line: usize,
    /// Column in characters, from 1.
    pub column: usize,
    /// How many characters the mistake spans; 0 where something is missing.
    pub length: usize,
    /// The text of the line.
    pub excerpt: String,
    /// What is wrong.
    pub message: String,
    /// What was expected there, or what to do.
    pub expected: Option<String>,
}

/// The mistakes found in a file of likelihoods, by position. At least one.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{}", listed(.errors))]
pub struct LikelihoodErrors {
    /// Each mistake; the first hundred of them.
    pub errors: Vec<LikelihoodError>,
}

fn listed(errors: &[LikelihoodError]) -> String {
    let lines = errors.iter().map(|error| match &error.expected {
        Some(expected) => format!("{error}: {expected}"),
        None => error.to_string(),
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// The mistakes found so far.
#[derive(Debug, Default)]
pub(super) struct Mistakes {
    found: Vec<(Range<usize>, String, Option<String>)>,
}

impl Mistakes {
    /// More mistakes than anybody reads are not kept.
    const MOST: usize = 100;

    /// Notes what is wrong at which bytes, and what would be right.
    pub(super) fn add(
        &mut self,
        span: Range<usize>,
        message: impl Into<String>,
        expected: impl Into<Option<String>>,
    ) {
        if self.found.len() < Self::MOST {
            self.found.push((span, message.into(), expected.into()));
        }
    }

    /// How many there are.
    pub(super) fn count(&self) -> usize {
        self.found.len()
    }

    /// `value`, unless there are mistakes; these in order of position, with lines and columns.
    pub(super) fn none_or<T>(mut self, value: T, text: &str) -> Result<T, LikelihoodErrors> {
        if self.found.is_empty() {
            return Ok(value);
        }
        self.found.sort_by_key(|(span, ..)| span.start);
        let found = self.found.into_iter();
        let errors = found.map(|(span, message, expected)| located(text, &span, message, expected));
        Err(LikelihoodErrors {
            errors: errors.collect(),
        })
    }
}

fn located(
    text: &str,
    span: &Range<usize>,
    message: String,
    expected: Option<String>,
) -> LikelihoodError {
    // Readers hand over positions between characters; a wrong one must not cost more than accuracy.
    let boundary = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let (start, end) = (boundary(span.start), boundary(span.end));
    let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let line_text = text[line_start..].lines().next().unwrap_or_default();
    let line_end = (line_start + line_text.len()).max(start);
    LikelihoodError {
        line: text[..start].matches('\n').count() + 1,
        column: text[line_start..start].chars().count() + 1,
        length: text[start..end.clamp(start, line_end)].chars().count(),
        excerpt: line_text.chars().take(160).collect(),
        message,
        expected,
    }
}
