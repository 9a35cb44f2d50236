//! Mistakes in a text, with their positions.

use elbowroom_text::{Diagnostics, Source};

/// Characters that end the marked word of a mistake.
const WORD_DELIMITERS: [char; 12] = [',', ';', '(', ')', '[', ']', '{', '}', '<', '>', '"', '='];

/// Collects mistakes and remarks while a text is read.
#[derive(Debug)]
pub(crate) struct Report {
    found: elbowroom_text::Report,
    remarks: Vec<String>,
}

impl Report {
    pub(crate) fn new(source: &Source) -> Self {
        Self {
            found: elbowroom_text::Report::new(source),
            remarks: Vec::new(),
        }
    }

    /// Reports a mistake in the word that begins at a byte of the text.
    pub(crate) fn mistake(
        &mut self,
        at: usize,
        message: impl Into<String>,
        help: impl Into<String>,
    ) {
        let text = self.found.source().text();
        let rest = text.get(at..).unwrap_or_default();
        let is_end = |c: char| c.is_whitespace() || WORD_DELIMITERS.contains(&c);
        let length = match rest.chars().next() {
            // A quotation is marked as a whole.
            Some('"') => rest[1..].find(['"', '\n']).map_or(1, |end| end + 2),
            Some(first) if first.is_whitespace() => 0,
            Some(first) if is_end(first) => 1,
            Some(_) => rest.find(is_end).unwrap_or(rest.len()),
            None => 0,
        };
        self.found
            .error(at..at + length, message)
            .advise(help.into());
    }

    /// Reports something that is interpreted differently from the text, or left out.
    pub(crate) fn remark(&mut self, remark: impl Into<String>) {
        let remark = remark.into();
        if !self.remarks.contains(&remark) {
            self.remarks.push(remark);
        }
    }

    pub(crate) fn is_failed(&self) -> bool {
        self.found.is_failed()
    }

    /// Returns the value with the remarks, or the mistakes sorted by position.
    pub(crate) fn finish<T>(self, value: Option<T>) -> Result<(T, Vec<String>), Diagnostics> {
        let (value, _) = self.found.finish(value)?;
        Ok((value, self.remarks))
    }
}
