//! Wrapping of long lines between words.

use unicode_width::UnicodeWidthStr;

/// Breaks the text into lines of at most `width` columns, if the words allow it. The first line is
/// indented by `indent`, the others by two more.
pub fn wrap(text: &str, width: usize, indent: usize) -> String {
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

/// Appends the words of `words` as a list item: in lines of at most `width` columns, the first
/// indented by `indent`, the others by two more.
pub fn push_wrapped(text: &mut String, words: &str, indent: usize, width: usize) {
    push_lines(text, words, [indent, indent + 2], width);
}

/// Appends the words of `words` as a paragraph, in lines of at most `width` columns.
pub fn push_paragraph(text: &mut String, words: &str, width: usize) {
    push_lines(text, words, [0, 0], width);
}

fn push_lines(text: &mut String, words: &str, [indent, hanging]: [usize; 2], width: usize) {
    let mut line = " ".repeat(indent);
    let mut is_empty = true;
    for word in words.split_whitespace() {
        let needed = line.width() + usize::from(!is_empty) + word.width();
        if !is_empty && needed > width {
            text.push_str(&line);
            text.push('\n');
            line = " ".repeat(hanging);
            is_empty = true;
        }
        if !is_empty {
            line.push(' ');
        }
        line.push_str(word);
        is_empty = false;
    }
    text.push_str(&line);
    text.push('\n');
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
