//! Texts to read, and places in them.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// A place in a text, in bytes: `start..end`.
pub type Span = Range<usize>;

/// A text with the name under which it is reported. Cheap to clone. Lines end with `\n`, `\r\n` or
/// `\r`.
///
/// `Source::from("…")` creates a source with the name `text`, for texts that are not from a file.
#[derive(Clone, PartialEq, Eq)]
pub struct Source(Arc<Inner>);

/// Some editors put it before a text.
const BYTE_ORDER_MARK: char = '\u{feff}';

/// The name under which a text without a name is reported.
const NAMELESS: &str = "text";

#[derive(PartialEq, Eq)]
struct Inner {
    name: String,
    text: String,
    /// Beginning of each line.
    lines: Vec<usize>,
}

impl Source {
    /// Creates a source with a name, usually the path of the file.
    pub fn new(name: impl Into<String>, text: impl Into<String>) -> Self {
        let mut text = text.into();
        if text.starts_with(BYTE_ORDER_MARK) {
            text.remove(0);
        }
        let is_end =
            |at: usize, character: &str| character == "\n" || !text[at + 1..].starts_with('\n');
        let lines = std::iter::once(0)
            .chain(
                text.match_indices(['\n', '\r'])
                    .filter(|&(at, character)| is_end(at, character))
                    .map(|(at, _)| at + 1),
            )
            .collect();
        Self(Arc::new(Inner {
            name: name.into(),
            text,
            lines,
        }))
    }

    /// Creates a source from bytes. Invalid UTF-8 becomes U+FFFD, which the readers report unless
    /// it is in a comment.
    pub fn from_bytes(name: impl Into<String>, bytes: &[u8]) -> Self {
        Self::new(name, String::from_utf8_lossy(bytes))
    }

    /// Returns the name under which the text is reported.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Returns the text.
    pub fn text(&self) -> &str {
        &self.0.text
    }

    /// Returns line and column, both from 1, of a byte position. Columns count characters.
    pub fn position(&self, at: usize) -> (usize, usize) {
        let at = self.boundary(at);
        let line = self.0.lines.partition_point(|&start| start <= at);
        let start = self.0.lines[line - 1];
        (line, self.text()[start..at].chars().count() + 1)
    }

    /// Returns the number of characters that a place spans on its first line.
    pub fn length(&self, span: &Span) -> usize {
        let start = self.boundary(span.start);
        let (line, _) = self.position(start);
        let end = self.boundary(span.end).min(self.line(line).end).max(start);
        self.text()[start..end].chars().count()
    }

    /// Returns the span of a line (from 1), without its line break. Empty past the end.
    pub fn line(&self, line: usize) -> Span {
        let end_of_text = self.text().len();
        let Some(&start) = self.0.lines.get(line.wrapping_sub(1)) else {
            return end_of_text..end_of_text;
        };
        let end = self.0.lines.get(line).map_or(end_of_text, |&next| next - 1);
        let line = &self.text()[start..end];
        let line = line.strip_suffix('\r').unwrap_or(line);
        start..start + line.len()
    }

    /// Returns the spans of all lines, without their line breaks.
    pub fn lines(&self) -> impl Iterator<Item = Span> + '_ {
        (1..=self.0.lines.len()).map(|line| self.line(line))
    }

    /// Returns the last position not after `at` that is between two characters of the text.
    pub(crate) fn boundary(&self, at: usize) -> usize {
        let mut at = at.min(self.text().len());
        while !self.text().is_char_boundary(at) {
            at -= 1;
        }
        at
    }
}

/// Prints the name and the text.
impl fmt::Debug for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Source")
            .field("name", &self.name())
            .field("text", &self.text())
            .finish()
    }
}

impl From<&str> for Source {
    fn from(text: &str) -> Self {
        Self::new(NAMELESS, text)
    }
}

impl From<&String> for Source {
    fn from(text: &String) -> Self {
        Self::new(NAMELESS, text.as_str())
    }
}

impl From<&[u8]> for Source {
    fn from(bytes: &[u8]) -> Self {
        Self::from_bytes(NAMELESS, bytes)
    }
}

impl<const LENGTH: usize> From<&[u8; LENGTH]> for Source {
    fn from(bytes: &[u8; LENGTH]) -> Self {
        Self::from_bytes(NAMELESS, bytes)
    }
}

impl From<&Vec<u8>> for Source {
    fn from(bytes: &Vec<u8>) -> Self {
        Self::from_bytes(NAMELESS, bytes)
    }
}

impl From<&Source> for Source {
    fn from(source: &Source) -> Self {
        source.clone()
    }
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
        assert_eq!(source.line(1), 0..2);
        assert_eq!(source.line(2), 3..5);
        assert_eq!(source.line(3), 7..8);
        assert_eq!(source.line(4), 8..8);
        assert_eq!(source.line(0), 8..8);
    }

    #[test]
    fn a_carriage_return_ends_a_line() {
        let source = Source::new("f", "ab\rcd\r\ne\r");
        let lines: Vec<_> = source.lines().collect();
        assert_eq!(lines, [0..2, 3..5, 7..8, 9..9]);
        assert_eq!(source.position(3), (2, 1));
    }

    #[test]
    fn a_length_counts_characters_up_to_the_end_of_the_line() {
        let source = Source::new("f", "açb\r\ncd");
        assert_eq!(source.length(&(1..3)), 1);
        assert_eq!(source.length(&(1..8)), 2);
        assert_eq!(source.length(&(2..2)), 0);
        assert_eq!(source.length(&(99..105)), 0);
    }

    #[test]
    fn a_byte_order_mark_is_not_part_of_the_text() {
        assert_eq!(Source::from_bytes("f", b"\xef\xbb\xbf(a)").text(), "(a)");
    }
}
