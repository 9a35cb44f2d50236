//! What is wrong in a text, and where.

use std::fmt;

/// More would help nobody.
const MOST_MISTAKES: usize = 20;

/// Characters of a line that are shown.
const EXCERPT: usize = 72;

/// One mistake in a file, or a reason to refuse it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    /// The line, or the part of it around the mistake where it is long.
    pub excerpt: String,
    /// How many characters of the excerpt stand before the mistake.
    pub offset: usize,
    /// What is wrong, in lower case.
    pub message: String,
    /// What to do.
    pub help: String,
}

/// Why a file cannot be read as a network.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistakes {
    /// The name of the file.
    pub name: String,
    /// What is wrong, at least one thing, in the order in which it was found.
    pub mistakes: Vec<Mistake>,
}

/// `name:line:column: message; help`, one line each.
impl fmt::Display for Mistakes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, mistake) in self.mistakes.iter().enumerate() {
            if index > 0 {
                writeln!(f)?;
            }
            let Mistake { line, column, .. } = mistake;
            write!(f, "{}:{line}:{column}: {}", self.name, mistake.message)?;
            if !mistake.help.is_empty() {
                write!(f, "; {}", mistake.help)?;
            }
        }
        Ok(())
    }
}

impl std::error::Error for Mistakes {}

/// Collects mistakes and remarks while a text is read.
#[derive(Debug)]
pub(crate) struct Report<'a> {
    text: &'a str,
    mistakes: Vec<Mistake>,
    remarks: Vec<String>,
}

impl<'a> Report<'a> {
    pub(crate) fn new(text: &'a str) -> Self {
        Self {
            text,
            mistakes: Vec::new(),
            remarks: Vec::new(),
        }
    }

    /// Notes a mistake at a byte of the text.
    pub(crate) fn mistake(
        &mut self,
        at: usize,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        if self.mistakes.len() >= MOST_MISTAKES {
            return;
        }
        let mut at = at.min(self.text.len());
        while !self.text.is_char_boundary(at) {
            at -= 1;
        }
        let before = &self.text[..at];
        let start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let rest = &self.text[start..];
        let line = rest.lines().next().unwrap_or_default();
        let column = before[start..].chars().count();
        let skipped = if column < EXCERPT * 2 / 3 {
            0
        } else {
            column - EXCERPT / 2
        };
        self.mistakes.push(Mistake {
            line: before.matches('\n').count() + 1,
            column: column + 1,
            excerpt: line.chars().skip(skipped).take(EXCERPT).collect(),
            offset: column - skipped,
            message: message.into(),
            help: help.into(),
        });
    }

    /// Notes something that is taken otherwise than the text says, or left out.
    pub(crate) fn remark(&mut self, remark: impl Into<String>) {
        let remark = remark.into();
        if !self.remarks.contains(&remark) {
            self.remarks.push(remark);
        }
    }

    pub(crate) fn is_failed(&self) -> bool {
        !self.mistakes.is_empty()
    }

    pub(crate) fn into_remarks(self) -> Vec<String> {
        self.remarks
    }

    pub(crate) fn into_mistakes(self, name: &str) -> Mistakes {
        Mistakes {
            name: name.to_owned(),
            mistakes: self.mistakes,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_place_in_a_long_line_is_shown_with_what_stands_around_it() {
        let text = format!("a\n{}X{}", "b".repeat(500), "c".repeat(500));
        let mut report = Report::new(&text);
        report.mistake(502, "an X", "");
        let mistake = &report.mistakes[0];
        assert_eq!((mistake.line, mistake.column), (2, 501));
        assert_eq!(mistake.excerpt.chars().nth(mistake.offset), Some('X'));
        assert_eq!(mistake.excerpt.chars().count(), EXCERPT);
    }

    #[test]
    fn a_place_past_the_end_is_the_end() {
        let mut report = Report::new("é");
        report.mistake(1, "inside a character", "");
        report.mistake(99, "past the end", "");
        let columns: Vec<_> = report.mistakes.iter().map(|m| m.column).collect();
        assert_eq!(columns, [1, 2]);
    }
}
