//! Conversion of text to parentheses and words.

use crate::report::Report;
use crate::source::{FileId, Span};

/// A parenthesis or a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Token<'s> {
    Open,
    Close,
    Word(&'s str),
}

/// Returns the tokens of a text with their positions. Reports invalid characters.
pub(crate) fn tokens<'s>(
    file: FileId,
    text: &'s str,
    report: &mut Report,
) -> Vec<(Token<'s>, Span)> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(first) = text[at..].chars().next() {
        let rest = &text[at..];
        let (length, token) = match first {
            '(' => (1, Some(Token::Open)),
            ')' => (1, Some(Token::Close)),
            ';' => (rest.find(['\n', '\r']).unwrap_or(rest.len()), None),
            _ if first.is_whitespace() => (first.len_utf8(), None),
            _ if is_stray(first) => {
                let length = rest.find(|c| !is_stray(c)).unwrap_or(rest.len());
                report_stray(first, span(file, at, length), report);
                (length, None)
            }
            _ => {
                let length = rest.find(ends_word).unwrap_or(rest.len());
                let length = operator_length(&rest[..length]).unwrap_or(length);
                (length, Some(Token::Word(&rest[..length])))
            }
        };
        if let Some(token) = token {
            tokens.push((token, span(file, at, length)));
        }
        at += length;
    }
    tokens
}

fn span(file: FileId, start: usize, length: usize) -> Span {
    Span {
        file,
        start,
        end: start + length,
    }
}

fn report_stray(first: char, span: Span, report: &mut Report) {
    let message = if first == char::REPLACEMENT_CHARACTER {
        "this is not UTF-8 text".to_owned()
    } else {
        format!("unexpected character U+{:04X}", u32::from(first))
    };
    report
        .error(span, message)
        .advise("PDDL is plain text: parentheses, words, numbers and `;` comments");
}

fn is_stray(character: char) -> bool {
    character == char::REPLACEMENT_CHARACTER
        || character == '"'
        || (character.is_control() && !character.is_whitespace())
}

fn ends_word(character: char) -> bool {
    matches!(character, '(' | ')' | ';') || character.is_whitespace() || is_stray(character)
}

/// Returns the length of an operator at the beginning of a word. It may be written without a space
/// before its operand, as in `(>=?x 3)`.
fn operator_length(word: &str) -> Option<usize> {
    let length = match word.as_bytes() {
        [b'<' | b'>', b'=', ..] => 2,
        [b'<' | b'>' | b'=' | b'*' | b'/', ..] => 1,
        _ => return None,
    };
    (word.len() > length).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;
    use elbowroom_text::Source;

    fn words(text: &str) -> (Vec<String>, usize) {
        let source = Source::new("f", text);
        let mut report = Report::new(&source, &source);
        let words = tokens(FileId::Domain, source.text(), &mut report)
            .into_iter()
            .map(|(token, _)| match token {
                Token::Open => "(".to_owned(),
                Token::Close => ")".to_owned(),
                Token::Word(word) => word.to_owned(),
            })
            .collect();
        (words, report.into_diagnostics().len())
    }

    #[test]
    fn comments_and_space_separate_words() {
        let (words, mistakes) = words("(a;b(\r\nc\t?d)");
        assert_eq!(words, ["(", "a", "c", "?d", ")"]);
        assert_eq!(mistakes, 0);
    }

    #[test]
    fn an_operator_needs_no_space_after_it() {
        assert_eq!(words("(>=?x -3)").0, ["(", ">=", "?x", "-3", ")"]);
        assert_eq!(words("(= a b)").0, ["(", "=", "a", "b", ")"]);
    }

    #[test]
    fn run_of_nul_bytes_is_one_error_unless_commented_out() {
        assert_eq!(words("a\0\0b").1, 1);
        assert_eq!(words(";a\0\0b").1, 0);
    }
}
