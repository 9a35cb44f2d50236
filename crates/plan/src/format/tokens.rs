//! Words and marks of an STN plan file.

/// Byte range of the text.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Span {
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Span {
    /// Returns the range from the beginning of this one to the end of `other`.
    pub(super) fn to(self, other: Self) -> Self {
        Self {
            start: self.start,
            end: other.end,
        }
    }
}

impl From<Span> for elbowroom_text::Span {
    fn from(span: Span) -> Self {
        span.start..span.end
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

/// Returns all words and marks, without comments.
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
