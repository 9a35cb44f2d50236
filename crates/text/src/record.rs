//! Diagnostics as plain data, for programs.

use serde::{Deserialize, Serialize};

use crate::diagnostic::{Diagnostic, Diagnostics, Label, Severity};

/// A [`Diagnostic`] as plain data, as printed by `--json` and used by editors.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Record {
    /// The severity: an error makes the text unusable.
    pub severity: Severity,
    /// The kind of finding, if the reader distinguishes kinds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub code: Option<String>,
    /// The message, in lower case.
    pub message: String,
    /// The form that was expected, or advice; `null` if there is none.
    pub advice: Option<String>,
    /// The name of the text, usually a path.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    /// Number of characters that the place spans on its line; 0 if something is missing there.
    pub length: usize,
    /// Remarks about this and other places.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub labels: Vec<RecordLabel>,
}

/// A remark about a place.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordLabel {
    /// The remark.
    pub text: String,
    /// The name of the text, usually a path.
    pub file: String,
    /// The line, from 1.
    pub line: usize,
    /// The column, from 1, in characters.
    pub column: usize,
    /// Number of characters that the place spans on its line.
    pub length: usize,
}

impl Diagnostic {
    /// Returns the finding as plain data, for programs.
    pub fn record(&self) -> Record {
        Record::from(self)
    }
}

impl Diagnostics {
    /// Returns all findings as plain data, for programs.
    pub fn records(&self) -> Vec<Record> {
        self.iter().map(Diagnostic::record).collect()
    }
}

impl From<&Diagnostic> for Record {
    fn from(diagnostic: &Diagnostic) -> Self {
        let remarks = diagnostic
            .labels
            .iter()
            .filter(|label| !label.text.is_empty());
        Self {
            severity: diagnostic.severity,
            code: diagnostic.code.map(str::to_owned),
            message: diagnostic.message.clone(),
            advice: diagnostic.advice.clone(),
            file: diagnostic.source().name().to_owned(),
            line: diagnostic.line(),
            column: diagnostic.column(),
            length: diagnostic.length(),
            labels: remarks.map(RecordLabel::from).collect(),
        }
    }
}

impl From<&Label> for RecordLabel {
    fn from(label: &Label) -> Self {
        let (line, column) = label.source.position(label.span.start);
        Self {
            text: label.text.clone(),
            file: label.source.name().to_owned(),
            line,
            column,
            length: label.source.length(&label.span),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::Source;

    #[test]
    fn record_has_position_and_advice() {
        let source = Source::new("a.txt", "one\ntwö three\n");
        let mut found = Diagnostic::new(Severity::Warning, &source, 9..14, "odd");
        found.label("here").advise("write 3");
        let json = serde_json::to_string(&found.record()).unwrap();
        assert_eq!(
            json,
            "{\"severity\":\"warning\",\"message\":\"odd\",\"advice\":\"write 3\",\
             \"file\":\"a.txt\",\"line\":2,\"column\":5,\"length\":5,\
             \"labels\":[{\"text\":\"here\",\"file\":\"a.txt\",\"line\":2,\"column\":5,\
             \"length\":5}]}"
        );
        let read: Record = serde_json::from_str(&json).unwrap();
        assert_eq!(read, found.record());
    }
}
