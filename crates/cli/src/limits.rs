//! What limits each end of each interval, with the ends that share a reason together.
//!
//! ```text
//! What limits the ends
//!   deadline of (counter-open office) at 40
//!     upper end of d0, d2, d3
//! ```

use unicode_width::UnicodeWidthStr;

use crate::look::{FAINT, Look, STRONG, styled};

/// One end of one parameter's interval, and what keeps it from moving.
#[derive(Clone, Debug)]
pub(crate) struct Limit {
    /// The parameter's name.
    pub(crate) parameter: String,
    /// Whether it is the upper end.
    pub(crate) is_upper: bool,
    /// Why it cannot move further out.
    pub(crate) reason: String,
}

/// The limits by reason, in the order in which the reasons first occur; empty without limits.
pub(crate) fn render(limits: &[Limit], look: Look) -> String {
    if limits.is_empty() {
        return String::new();
    }
    let mut reasons: Vec<&str> = Vec::new();
    for limit in limits {
        if !reasons.contains(&limit.reason.as_str()) {
            reasons.push(&limit.reason);
        }
    }
    let mut text = format!("{}\n", styled(STRONG, "What limits the ends"));
    for reason in reasons {
        push_wrapped(&mut text, reason, 2, look.width);
        for (is_upper, label) in [(false, "lower end of"), (true, "upper end of")] {
            let names: Vec<&str> = limits
                .iter()
                .filter(|limit| limit.reason == reason && limit.is_upper == is_upper)
                .map(|limit| limit.parameter.as_str())
                .collect();
            if !names.is_empty() {
                let mut line = String::new();
                push_wrapped(
                    &mut line,
                    &format!("{label} {}", names.join(", ")),
                    4,
                    look.width,
                );
                text.push_str(&styled(FAINT, line.trim_end()));
                text.push('\n');
            }
        }
    }
    text
}

/// Appends the words of `words` as a list item: in lines of at most `width` columns, the first
/// indented by `indent`, the others by two more.
pub(crate) fn push_wrapped(text: &mut String, words: &str, indent: usize, width: usize) {
    push_lines(text, words, [indent, indent + 2], width);
}

/// Appends the words of `words` as a paragraph, in lines of at most `width` columns.
pub(crate) fn push_paragraph(text: &mut String, words: &str, width: usize) {
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
    use insta::assert_snapshot;

    use super::{Limit, render};
    use crate::look::Look;

    #[test]
    fn ends_with_the_same_reason_stand_together() {
        let limit = |parameter: &str, is_upper, reason: &str| Limit {
            parameter: parameter.to_owned(),
            is_upper,
            reason: reason.to_owned(),
        };
        let deadline = "deadline of (counter-open office) at 40: end of (drop rover parcel office) \
                        must come 0.001 before it";
        let limits = [
            limit("d0", false, "a duration is at least 0"),
            limit("d0", true, deadline),
            limit("d1", false, "a duration is at least 0"),
            limit("d1", true, deadline),
        ];
        let text = anstream::adapter::strip_str(&render(&limits, Look::PLAIN)).to_string();
        assert_snapshot!(text, @r"
        What limits the ends
          a duration is at least 0
            lower end of d0, d1
          deadline of (counter-open office) at 40: end of (drop rover parcel office)
            must come 0.001 before it
            upper end of d0, d1
        ");
    }
}
