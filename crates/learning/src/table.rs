//! Logs as tables: CSV with a header, one attempt per row (`docs/reference/formats/log-csv.md`).

use elbowroom_text::{Diagnostic, Diagnostics, Report, Severity, Source, Span, nearest};

use crate::records::{Outcome, Record};

/// Required columns, in any order.
const REQUIRED: [&str; 4] = ["action", "start", "end", "outcome"];
/// Optional columns.
const OPTIONAL: [&str; 2] = ["commanded", "planned"];
const OUTCOMES: [&str; 4] = ["succeeded", "failed", "cancelled", "running"];

/// Reads a table.
///
/// # Errors
/// All errors, with their positions.
pub fn read(source: &Source) -> Result<Vec<Record>, Diagnostics> {
    let mut reader = csv::ReaderBuilder::new()
        .flexible(true)
        .trim(csv::Trim::All)
        .comment(Some(b'#'))
        .from_reader(source.text().as_bytes());
    let mut report = Report::new(source);
    let mut records = Vec::new();
    let header = match reader.headers() {
        Ok(header) => header.clone(),
        Err(error) => {
            let place = span_at(source, error.position());
            return Err(error_at(source, place, unreadable(&error)).into());
        }
    };
    let columns = columns(source, &header).map_err(Diagnostics::from)?;
    for row in reader.records() {
        let row = match row {
            Ok(row) => row,
            Err(error) => {
                report.error(span_at(source, error.position()), unreadable(&error));
                continue;
            }
        };
        let place = span_at(source, row.position());
        match record(&columns, &row) {
            Ok(record) => records.push(record),
            Err(message) => {
                report.error(place, message);
            }
        }
    }
    report.finish(Some(records)).map(|(records, _)| records)
}

/// Position of each column.
struct Columns {
    action: usize,
    start: usize,
    end: usize,
    outcome: usize,
    commanded: Option<usize>,
    planned: Option<usize>,
}

fn columns(source: &Source, header: &csv::StringRecord) -> Result<Columns, Diagnostic> {
    let place = span_at(source, header.position());
    let find = |name: &str| {
        header
            .iter()
            .position(|column| column.eq_ignore_ascii_case(name))
    };
    let known = REQUIRED.iter().chain(&OPTIONAL).copied();
    for column in header {
        if !known.clone().any(|name| column.eq_ignore_ascii_case(name)) {
            let names = known.clone().collect::<Vec<_>>().join(", ");
            let mut message = format!("unknown column `{column}`; known are {names}");
            let separator = [';', '\t'].into_iter().find(|mark| column.contains(*mark));
            if let Some(mark) = separator {
                let mark = if mark == ';' { "semicolons" } else { "tabs" };
                message = format!("the columns are separated by {mark}, expected commas");
            } else if let Some(near) = nearest(&column.to_lowercase(), known.clone()) {
                message = format!("{message}; did you mean `{near}`?");
            }
            return Err(error_at(source, place, message));
        }
    }
    let needed = |name: &str| {
        find(name).ok_or_else(|| {
            let message = format!("the column `{name}` is missing from the first line");
            error_at(source, place.clone(), message)
        })
    };
    Ok(Columns {
        action: needed("action")?,
        start: needed("start")?,
        end: needed("end")?,
        outcome: needed("outcome")?,
        commanded: find("commanded"),
        planned: find("planned"),
    })
}

fn record(columns: &Columns, row: &csv::StringRecord) -> Result<Record, String> {
    let field = |column: usize| row.get(column).unwrap_or_default();
    let optional = |column: Option<usize>, name: &str| match column.map(field) {
        None | Some("") => Ok(None),
        Some(text) => number(text, name).map(Some),
    };
    let action = action(field(columns.action))?;
    let outcome = match field(columns.outcome).to_lowercase().as_str() {
        "succeeded" => Outcome::Succeeded,
        "failed" => Outcome::Failed,
        "cancelled" => Outcome::Cancelled,
        "running" => Outcome::Running,
        other => {
            let known = OUTCOMES.join(", ");
            let meant = match other {
                "ok" | "success" | "done" => "; did you mean `succeeded`?",
                "error" | "failure" => "; did you mean `failed`?",
                "canceled" | "aborted" => "; did you mean `cancelled`?",
                _ => "",
            };
            return Err(format!(
                "unknown outcome `{other}`; known are {known}{meant}"
            ));
        }
    };
    let start = optional(Some(columns.start), "start")?;
    let commanded = optional(columns.commanded, "commanded")?;
    let planned = optional(columns.planned, "planned")?;
    let end = number(field(columns.end), "end")?;
    if outcome == Outcome::Succeeded && start.is_none() {
        return Err("an action that succeeded needs a start".to_owned());
    }
    if start.is_none() && commanded.is_none() {
        return Err("both the start and the command are missing".to_owned());
    }
    if start.is_some_and(|start| end < start) {
        return Err("the end is before the start".to_owned());
    }
    if let (Some(start), Some(commanded)) = (start, commanded)
        && start < commanded
    {
        return Err("the start is before the command".to_owned());
    }
    if planned.is_some_and(|planned| planned < 0.0) {
        return Err("the planned duration is negative".to_owned());
    }
    Ok(Record {
        action,
        commanded,
        start,
        end,
        outcome,
        planned,
    })
}

/// Normalises the action to the form in plans: parentheses, lower case, single spaces.
fn action(text: &str) -> Result<String, String> {
    let inner = text
        .strip_prefix('(')
        .and_then(|text| text.strip_suffix(')'));
    let words: Vec<String> = inner
        .unwrap_or(text)
        .split_whitespace()
        .map(str::to_lowercase)
        .collect();
    let is_name = |word: &String| {
        word.chars()
            .all(|c| !c.is_control() && !matches!(c, '(' | ')' | '"' | '\\'))
    };
    if words.is_empty() || !words.iter().all(is_name) {
        return Err(format!(
            "expected an action, such as `(drive rover depot shelf)`, found `{text}`"
        ));
    }
    Ok(format!("({})", words.join(" ")))
}

fn number(text: &str, column: &str) -> Result<f64, String> {
    let value: Result<f64, _> = text.parse();
    match value {
        Ok(value) if value.is_finite() => Ok(value),
        _ if text.is_empty() => Err(format!("the {column} is missing")),
        _ => Err(format!(
            "expected seconds in the column {column}, found `{text}`"
        )),
    }
}

fn span_at(source: &Source, position: Option<&csv::Position>) -> Span {
    let start = position.map_or(0, |position| {
        usize::try_from(position.byte()).unwrap_or(usize::MAX)
    });
    let start = start.min(source.text().len());
    let rest = &source.text()[start..];
    let skipped = rest.len() - rest.trim_start().len();
    let line = rest.trim_start().lines().next().unwrap_or_default();
    start + skipped..start + skipped + line.trim_end().len()
}

fn error_at(source: &Source, place: Span, message: impl Into<String>) -> Diagnostic {
    Diagnostic::new(Severity::Error, source, place, message)
}

fn unreadable(error: &csv::Error) -> String {
    format!("cannot read the table: {error}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_is_parsed() {
        let text = "outcome, action, start, end, planned\n\
                    succeeded, (Drive rover a b), 1, 11.5, 10\n\
                    # a remark\n\
                    failed, drive rover b a, 12, 14,\n\
                    running, (wait), 15, 20, \n";
        let records = read(&Source::from(text)).expect("a table");
        assert_eq!(records.len(), 3);
        assert_eq!(records[0].action, "(drive rover a b)");
        assert_eq!(records[0].name(), "drive");
        assert_eq!(records[0].planned, Some(10.0));
        assert_eq!(records[1].outcome, Outcome::Failed);
        assert_eq!(records[2].end.to_bits(), 20.0_f64.to_bits());
    }

    #[test]
    fn errors_name_their_line() {
        let said = |text: &str| {
            let wrong = read(&Source::from(text)).expect_err("a mistake");
            wrong.to_string()
        };
        let head = "action,start,end,outcome\n";
        for (row, part) in [
            (
                "(a),1,0,succeeded",
                "2:1: error: the end is before the start",
            ),
            (
                "(a),x,2,succeeded",
                "expected seconds in the column start, found `x`",
            ),
            ("(a),1,,succeeded", "the end is missing"),
            ("(a),1,inf,succeeded", "expected seconds"),
            ("(a),1,2,done", "unknown outcome `done`"),
            (",1,2,succeeded", "expected an action"),
            ("(a),,2,succeeded", "needs a start"),
            (
                "(a),,2,failed",
                "both the start and the command are missing",
            ),
        ] {
            let said = said(&format!("{head}{row}\n"));
            assert!(said.contains(part), "{row}: {said}");
        }
        assert!(said("").contains("`action` is missing"));
        assert!(said("action,start,end,outcme\n").contains("did you mean `outcome`"));
    }
}
