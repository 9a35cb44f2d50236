//! Wrapping of long lines between words.

use unicode_width::UnicodeWidthStr;

/// Breaks the text into lines of at most `width` columns, if the words allow it. The first line is
/// indented by `indent`, the others by two more.
pub(crate) fn wrap(text: &str, width: usize, indent: usize) -> String {
    let mut lines = Vec::new();
    let mut line = " ".repeat(indent);
    let mut is_empty = true;
    for word in text.split(' ') {
        if !is_empty && line.width() + 1 + word.width() > width {
            lines.push(std::mem::replace(&mut line, " ".repeat(indent + 2)));
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    lines.push(line);
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::wrap;

    #[test]
    fn lines_break_between_words_with_hanging_indent() {
        let text = wrap("one two three four", 11, 2);
        assert_eq!(text, "  one two\n    three\n    four");
        assert_eq!(wrap("indivisible word", 4, 0), "indivisible\n  word");
        assert_eq!(wrap("", 4, 1), " ");
    }
}
