//! Texts to read, and positions in them.

use std::ops::Range;
use std::sync::Arc;

/// A text with the name it is reported under. Cheap to clone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source(Arc<Inner>);

/// Some editors put it before a text.
const BYTE_ORDER_MARK: char = '\u{feff}';

#[derive(Debug, PartialEq, Eq)]
struct Inner {
    name: String,
    text: String,
    /// Where each line begins.
    lines: Vec<usize>,
}

impl Source {
    /// A text under a name, usually the path of the file it comes from.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if text.starts_with(BYTE_ORDER_MARK) {
            text.remove(0);
        }
        let lines = std::iter::once(0)
            .chain(text.match_indices('\n').map(|(at, _)| at + 1))
            .collect();
        Self(Arc::new(Inner {
            name: name.into(),
            text,
            lines,
        }))
    }

    /// The same from bytes. What is not UTF-8 becomes U+FFFD, which the readers report unless it
    /// stands in a comment.
    pub fn from_bytes(name: impl Into<String>, bytes: &[u8]) -> Self {
        Self::new(name, String::from_utf8_lossy(bytes))
    }

    /// The name it is reported under.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// The text.
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// Line and column, both from 1, of a byte position. Columns count characters.
    pub fn position(&self, at: usize) -> (usize, usize) {
        let mut at = at.min(self.text().len());
        while !self.text().is_char_boundary(at) {
            at -= 1;
        }
        let line = self.0.lines.partition_point(|&start| start <= at);
        let start = self.0.lines[line - 1];
        (line, self.text()[start..at].chars().count() + 1)
    }

    /// Where a line (from 1) lies, without its line break. Empty past the end.
    pub(crate) fn line_range(&self, line: usize) -> Range<usize> {
        let end_of_text = self.text().len();
        let start = self.0.lines.get(line - 1).copied().unwrap_or(end_of_text);
        let end = self.0.lines.get(line).map_or(end_of_text, |&next| next - 1);
        let line = &self.text()[start..end];
        start..start + line.trim_end_matches('\r').len()
    }
}

/// A stretch of one of the texts being read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Which of the texts.
    pub(crate) file: FileId,
    /// First byte.
    pub(crate) start: usize,
    /// One past the last byte.
    pub(crate) end: usize,
}

/// Which of the texts that are read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileId {
    Domain,
    Problem,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_lines_and_characters_from_one() {
        let source = Source::new("f", "ab\nçd\r\n");
        assert_eq!(source.position(0), (1, 1));
        assert_eq!(source.position(3), (2, 1));
        assert_eq!(source.position(5), (2, 2));
        assert_eq!(source.position(99), (3, 1));
    }

    #[test]
    fn a_line_ends_before_its_break() {
        let source = Source::new("f", "ab\ncd\r\ne");
        assert_eq!(source.line_range(1), 0..2);
        assert_eq!(source.line_range(2), 3..5);
        assert_eq!(source.line_range(3), 7..8);
        assert_eq!(source.line_range(4), 8..8);
    }

    #[test]
    fn a_byte_order_mark_is_not_part_of_the_text() {
        assert_eq!(Source::from_bytes("f", b"\xef\xbb\xbf(a)").text(), "(a)");
    }
}
