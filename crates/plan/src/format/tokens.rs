//! Words and marks of an STN plan file, and mistakes by position.

use super::FormatError;

/// A stretch of the text, in bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Span {
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Span {
    /// From the beginning of this to the end of `other`.
    pub(super) fn to(self, other: Self) -> Self {
        Self {
            start: self.start,
            end: other.end,
        }
    }
}

/// A word, or one of the marks `: ; ( ) [ ] ,`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Token<'a> {
    pub(crate) text: &'a str,
    pub(super) span: Span,
}

impl Token<'_> {
    pub(super) fn is_word(&self) -> bool {
        !self.text.starts_with(is_mark)
    }
}

fn is_mark(c: char) -> bool {
    matches!(c, ':' | ';' | '(' | ')' | '[' | ']' | ',')
}

/// All words and marks, comments left out.
pub(crate) fn tokens(text: &str) -> Vec<Token<'_>> {
    let mut tokens = Vec::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let start = text.len() - rest.len();
        let length = if first.is_whitespace() {
            first.len_utf8()
        } else if first == '#' {
            rest.find('\n').unwrap_or(rest.len())
        } else {
            let length = if is_mark(first) {
                1
            } else {
                rest.find(|c: char| c.is_whitespace() || c == '#' || is_mark(c))
                    .unwrap_or(rest.len())
            };
            let end = start + length;
            tokens.push(Token {
                text: &text[start..end],
                span: Span { start, end },
            });
            length
        };
        rest = &rest[length..];
    }
    tokens
}

/// The mistakes found so far.
#[derive(Debug, Default)]
pub(super) struct Mistakes {
    found: Vec<(Span, String, Option<String>)>,
}

impl Mistakes {
    /// More mistakes than anybody reads are not kept.
    const MOST: usize = 100;

    pub(super) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Notes what is wrong where, and what would be right.
    pub(super) fn add(
        &mut self,
        span: Span,
        message: impl Into<String>,
        expected: impl Into<Option<String>>,
    ) {
        if self.found.len() < Self::MOST {
            self.found.push((span, message.into(), expected.into()));
        }
    }

    /// The mistakes in order of position, with lines and columns.
    pub(super) fn located(mut self, text: &str) -> Vec<FormatError> {
        self.found.sort_by_key(|(span, ..)| *span);
        let mut line_starts = vec![0];
        line_starts.extend(text.match_indices('\n').map(|(at, _)| at + 1));
        self.found
            .into_iter()
            .map(|(span, message, expected)| {
                let line = line_starts.partition_point(|&start| start <= span.start);
                let line_start = line_starts[line - 1];
                let line_text = text[line_start..].lines().next().unwrap_or_default();
                let line_end = line_start + line_text.len();
                let marked = &text[span.start..span.end.min(line_end).max(span.start)];
                FormatError {
                    line,
                    column: text[line_start..span.start].chars().count() + 1,
                    length: marked.chars().count(),
                    excerpt: around(line_text, span.start.min(line_end) - line_start),
                    message,
                    expected,
                }
            })
            .collect()
    }
}

/// The line, or, if it is very long, what stands around the byte at `at`.
fn around(line: &str, at: usize) -> String {
    const REACH: usize = 80;
    let before = line[..at].char_indices().rev().nth(REACH - 1);
    let from = before.map_or(0, |(index, _)| index);
    line[from..].chars().take(2 * REACH).collect()
}
