//! Detection of a file's format, and the readers.

mod dimacs;
mod distribution;
mod elbowroom;
mod graphml;
mod heatlab;
mod inequalities;
mod plain;
mod pstn_lib;

use elbowroom_num::Rational;
use elbowroom_text::{Diagnostics, Source};

use crate::file::NetworkFile;
use crate::json::{self, Json, Value};
use crate::number::Bound;
use crate::report::Report;

/// Extensions of files with unsupported kinds of networks, and the names of these kinds.
const REFUSED: [(&str, &str); 6] = [
    ("cstn", "a conditional network (CSTN)"),
    ("cstnu", "a conditional network with uncertainty (CSTNU)"),
    ("cstnud", "a conditional network with decisions (CSTNUD)"),
    (
        "cstnpsu",
        "a conditional network with partially shrinkable uncertainty (CSTNPSU)",
    ),
    (
        "cstpsu",
        "a conditional network with partially shrinkable uncertainty (CSTPSU)",
    ),
    ("pstn", "a probabilistic network of the CSTNU Tool (PSTN)"),
];

/// Advice on unsupported kinds of networks.
const REFUSED_HELP: &str =
    "simple networks (STN) and networks with contingent links (STNU) are read";

/// Reads a file of any of the known formats. The name is used in messages. Its extension is only
/// used if the text does not determine the kind of network.
///
/// # Errors
/// If the bytes are not a network, or if the kind of network is not supported.
pub fn read(name: &str, bytes: &[u8]) -> Result<NetworkFile, Diagnostics> {
    let source = Source::from_bytes(name, bytes);
    let mut report = Report::new(&source);
    let file = detect_format(name, source.text(), &mut report);
    let (mut file, remarks) = report.finish(file)?;
    file.remarks = remarks;
    Ok(file)
}

fn detect_format(name: &str, text: &str, report: &mut Report) -> Option<NetworkFile> {
    let ending = file_extension(name);
    if let Some((_, kind)) = REFUSED.iter().find(|(refused, _)| *refused == ending) {
        report.mistake(
            0,
            format!("this is {kind}, which is not supported"),
            REFUSED_HELP,
        );
        return None;
    }
    let start = text.len() - text.trim_start().len();
    let first = text[start..].lines().next().unwrap_or_default();
    match text[start..].chars().next() {
        Some('<') => graphml::read(text, &ending, report),
        Some('{' | '[') => detect_json_format(text, report),
        Some('#') => plain::read(text, report),
        Some(_) if dimacs::is_line(first) => dimacs::read(text, report),
        Some(_) if is_trace(first) => {
            report.mistake(
                start,
                "this file contains execution traces, not a network",
                "give the network of these traces",
            );
            None
        }
        None => {
            report.mistake(0, "the file is empty", "give a file with a network");
            None
        }
        Some(_) => {
            report.mistake(
                start,
                "unrecognised network format",
                "expected JSON, GraphML, plain STNU text that begins with `# KIND OF NETWORK`, or \
                 DIMACS text",
            );
            None
        }
    }
}

/// Returns the extension of a file's name, in lower case.
fn file_extension(name: &str) -> String {
    let base = name.rsplit(['/', '\\']).next().unwrap_or_default();
    match base.rsplit_once('.') {
        Some((_, ending)) => ending.to_ascii_lowercase(),
        None => String::new(),
    }
}

/// Returns `true` if a line looks like `Z=0, A=3, C(A)=7`.
fn is_trace(line: &str) -> bool {
    let is_event = |event: &str| {
        let (name, time) = event.split_once('=')?;
        let is_name = !name.trim().is_empty();
        let is_time = Bound::parse(time).is_some();
        (is_name && is_time).then_some(())
    };
    line.split(',').next().and_then(is_event).is_some()
}

fn detect_json_format(text: &str, report: &mut Report) -> Option<NetworkFile> {
    let document = json::parse(text, report)?;
    if document.member("format").and_then(Json::text) == Some(elbowroom::FORMAT) {
        return elbowroom::read(&document, report);
    }
    if document.member("nodes").is_some() {
        return heatlab::read(&document, report);
    }
    if document.member("timepoints").is_some() {
        return pstn_lib::read(&document, report);
    }
    if inequalities::are_in(&document) {
        return inequalities::read(&document, report);
    }
    report.mistake(
        document.at,
        "this JSON is not a network of a known format",
        "expected `nodes` and `constraints` (HEATlab), `timepoints` and `constraints` (PSTN-lib), \
         lists of inequalities under the numbers of nodes, or `\"format\": \"elbowroom-network\"`",
    );
    None
}

/// Returns the list under a name; reports a mistake if it is missing.
fn list<'j, 'a>(parent: &'j Json<'a>, name: &str, report: &mut Report) -> &'j [Json<'a>] {
    let Some(member) = required(parent, name, report) else {
        return &[];
    };
    let items = member.list();
    if items.is_none() {
        report.mistake(
            member.at,
            format!("`{name}` is {}, not a list", member.kind()),
            format!("write `\"{name}\": [ … ]`"),
        );
    }
    items.unwrap_or_default()
}

/// Returns the member of that name; reports a mistake if it is missing.
fn required<'j, 'a>(parent: &'j Json<'a>, name: &str, report: &mut Report) -> Option<&'j Json<'a>> {
    let member = parent.member(name);
    if member.is_none() {
        report.mistake(
            parent.at,
            format!("missing member `{name}`"),
            format!("add `\"{name}\": …`"),
        );
    }
    member
}

/// Reads a number or an infinity, given as a number or a string.
fn bound(json: &Json<'_>, report: &mut Report) -> Option<Bound> {
    let read = match &json.value {
        Value::Number(number) => Bound::parse(number),
        Value::Text(text) => Bound::parse(text),
        _ => None,
    };
    if read.is_none() {
        report.mistake(
            json.at,
            "this is not a number",
            "write a decimal such as 12.5, a fraction such as \"25/2\", \"inf\" or \"-inf\"",
        );
    }
    read
}

/// Reads a finite number.
fn number(json: &Json<'_>, report: &mut Report) -> Option<Rational> {
    match bound(json, report)? {
        Bound::Finite(number) => Some(number),
        Bound::Infinity | Bound::NegativeInfinity => {
            report.mistake(json.at, "this number must be finite", "write a decimal");
            None
        }
    }
}

/// Reads a bound under a name; returns `missing` if there is none.
fn optional_bound(
    parent: &Json<'_>,
    name: &str,
    missing: Bound,
    report: &mut Report,
) -> Option<Bound> {
    match parent.member(name) {
        Some(json) if !matches!(json.value, Value::Null) => bound(json, report),
        _ => Some(missing),
    }
}

/// Reads the name of a time point: a number or a string.
fn point_name(json: &Json<'_>, report: &mut Report) -> Option<String> {
    match &json.value {
        Value::Number(number) => Some((*number).to_owned()),
        Value::Text(text) => Some(text.clone().into_owned()),
        _ => {
            report.mistake(
                json.at,
                format!("the name of a time point cannot be {}", json.kind()),
                "write a number or a text",
            );
            None
        }
    }
}

/// Reads a symmetric matrix with `size` rows and 1 in its diagonal.
fn correlation_matrix(
    parent: &Json<'_>,
    name: &str,
    size: usize,
    report: &mut Report,
) -> Option<Vec<Vec<Rational>>> {
    let matrix: Vec<Vec<Rational>> = list(parent, name, report)
        .iter()
        .map(|row| {
            let numbers = row.list().unwrap_or_default().iter();
            numbers.filter_map(|json| number(json, report)).collect()
        })
        .collect();
    let one = Rational::ONE;
    let is_row = |(row, numbers): (usize, &Vec<Rational>)| {
        let is_symmetric = numbers.iter().enumerate().all(|(column, number)| {
            let mirrored = matrix.get(column).and_then(|other| other.get(row));
            mirrored == Some(number) && number.abs() <= one
        });
        numbers.len() == size && numbers.get(row) == Some(&one) && is_symmetric
    };
    if matrix.len() == size && matrix.iter().enumerate().all(is_row) {
        return Some(matrix);
    }
    report.mistake(
        parent.at,
        "this is not a correlation matrix of these durations",
        "expected a symmetric matrix with a row and a column for each, and 1 in its diagonal",
    );
    None
}
