//! Guarantees, objectives and reasons: their names in JSON, documents, Python and pages are those of their tables.

use std::fs;

use elbowroom::answers::plan::PlanObjective;
use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::execution::{Cause, GuaranteeLevel};
use serde::Serialize;

use crate::workspace;

/// Returns the names of a table.
type Names = fn() -> Vec<&'static str>;

/// Files that list all names of a table.
const LISTS: &[(&str, Names)] = &[
    ("docs/reference/guarantees.md", || names(Guarantee::TERMS)),
    ("docs/reference/formats/trace.md", || {
        names(Guarantee::TERMS)
    }),
    ("crates/python/python/elbowroom/_problem.py", || {
        names(Guarantee::TERMS)
    }),
    ("crates/python/python/elbowroom/_answers.py", || {
        names(Guarantee::TERMS)
    }),
    ("docs/reference/largest-box.md", || names(Objective::TERMS)),
    ("docs/reference/formats/trace.md", || {
        names(Objective::TERMS)
    }),
    ("docs/reference/chosen-plans.md", || {
        names(PlanObjective::TERMS)
    }),
    ("docs/reference/formats/trace.md", || {
        names(GuaranteeLevel::TERMS)
    }),
    ("crates/executive/src/interface/documents.rs", || {
        names(GuaranteeLevel::TERMS)
    }),
    ("crates/page/src/operator/slack.js", || {
        let known = GuaranteeLevel::TERMS
            .iter()
            .filter_map(|(level, ..)| level.condition());
        known.collect()
    }),
];

fn names<T>(terms: &[(T, &'static str, &'static str)]) -> Vec<&'static str> {
    terms.iter().map(|(_, name, _)| *name).collect()
}

fn text(path: &str) -> String {
    fs::read_to_string(workspace().join(path)).expect("a file of the project")
}

/// Returns `true` if the text has the name as a word of its own in code or quotes, or the condition.
fn lists(text: &str, name: &str) -> bool {
    text.contains(&format!("`{name}`"))
        || text.contains(&format!("\"{name}\""))
        || (name.contains(' ') && text.contains(name))
}

#[test]
fn lists_of_terms_are_complete() {
    for (path, names) in LISTS {
        let text = text(path);
        for name in names() {
            assert!(lists(&text, name), "{path} does not list `{name}`");
        }
    }
}

#[test]
fn missing_name_is_noticed() {
    assert!(lists("one of `weak`, \"strong\"", "strong"));
    assert!(!lists("one of `weak`, stronger", "strong"));
}

#[test]
fn names_in_json_are_those_of_the_tables() {
    fn check<T: Serialize + Copy>(
        terms: &[(T, &'static str, &'static str)],
        other: &[(&str, &str)],
    ) {
        for (term, name, _) in terms {
            let json = serde_json::to_value(term).expect("a name");
            let expected = other
                .iter()
                .find(|(own, _)| own == name)
                .map_or(*name, |(_, json)| json);
            assert_eq!(json, expected);
        }
    }
    check(Guarantee::TERMS, &[]);
    check(Objective::TERMS, &[]);
    // Documents of version 1 keep this name.
    check(PlanObjective::TERMS, &[("slack", "room")]);
}

/// Certificates have their own types, because their checker shares no code with the search.
#[test]
fn certificates_use_the_same_names_of_guarantees() {
    for (_, name, _) in Guarantee::TERMS {
        let read = serde_json::from_value::<elbowroom::verify::Guarantee>((*name).into());
        assert!(read.is_ok(), "{name}");
    }
}

/// `ELBOWROOM_UPDATE_DOCS=1 cargo test -p elbowroom --test layers terms` updates the table.
#[test]
fn trace_document_lists_the_causes() {
    const PATH: &str = "docs/reference/formats/trace.md";
    let (begin, end) = ("<!-- causes: begin -->\n", "<!-- causes: end -->");
    let page = text(PATH);
    let (before, rest) = page.split_once(begin).expect("a place for the table");
    let (listed, after) = rest.split_once(end).expect("an end of the table");
    let rows = Cause::TERMS
        .iter()
        .map(|(_, name, meaning)| format!("| `{name}` | {meaning} |\n"));
    let table = format!(
        "\n| cause | meaning |\n|---|---|\n{}\n",
        rows.collect::<String>()
    );
    if listed != table && std::env::var_os("ELBOWROOM_UPDATE_DOCS").is_some() {
        let page = format!("{before}{begin}{table}{end}{after}");
        fs::write(workspace().join(PATH), page).expect("the page can be written");
        return;
    }
    assert_eq!(
        listed, table,
        "{PATH} is out of date; ELBOWROOM_UPDATE_DOCS=1 updates it"
    );
}
