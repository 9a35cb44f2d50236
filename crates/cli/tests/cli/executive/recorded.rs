//! A journal with background planning and preparation, recorded on 28 November 2026. Its replay
//! still makes the same decisions, and it can be resumed wherever it is cut.

use std::fs;

use serde_json::Value;

use super::client::{Executive, folder};
use super::command::{elbowroom, root};
use super::python_is_there;

const JOURNAL: &str = "crates/cli/tests/files/golden/executive.journal";

/// Returns numbers of lines after which the executive may have died: after the request for a plan,
/// after its arrival, and after its preparation.
fn cuts(lines: &[&str]) -> Vec<usize> {
    let kinds = [
        "{\"event\":\"planning\"",
        "[{\"type\":\"plan-made\"",
        "[{\"type\":\"plan-ready\"",
    ];
    let after = |kind: &&str| -> Vec<usize> {
        let found = lines
            .iter()
            .enumerate()
            .filter(|(_, line)| line.contains(*kind));
        found.map(|(index, _)| index + 1).collect()
    };
    let mut cuts: Vec<usize> = kinds.iter().flat_map(after).collect();
    cuts.push(lines.len());
    cuts.sort_unstable();
    cuts
}

#[test]
fn recorded_journal_replays_after_any_truncation() {
    let text = fs::read_to_string(root().join(JOURNAL)).expect("a journal");
    let lines: Vec<&str> = text.lines().collect();
    let place = folder("played-back");
    let journal = place.join("journal").display().to_string();
    let cuts = cuts(&lines);
    assert!(cuts.len() > 10, "{cuts:?}");
    for cut in cuts {
        fs::write(&journal, lines[..cut].join("\n") + "\n").expect("written");
        let replay = elbowroom(&["run", "--json", "--replay", &journal]);
        assert_eq!(replay.status.code(), Some(0), "{cut}: {replay:?}");
        let document: Value = serde_json::from_slice(&replay.stdout).expect("a document");
        assert_eq!(document["agrees"], true, "{cut}: {document}");
        // All lines except the header are entries.
        assert_eq!(document["entries"], cut - 1, "{cut}: {document}");
    }
}

/// A resumed executive ends with success on a stop request only if the replay made the same
/// decisions.
#[test]
fn recorded_journal_resumes_after_any_truncation() {
    if !python_is_there() {
        return;
    }
    let text = fs::read_to_string(root().join(JOURNAL)).expect("a journal");
    let lines: Vec<&str> = text.lines().collect();
    let cuts = cuts(&lines);
    for cut in cuts.into_iter().step_by(2) {
        let place = folder(&format!("recorded-{cut}"));
        let journal = place.join("journal").display().to_string();
        fs::write(&journal, lines[..cut].join("\n") + "\n").expect("written");
        let mut own = Executive::start(&place, &["--resume", &journal]);
        own.await_state(|state| state["activity"].is_string());
        own.post("/v1/stop", &Value::Null);
        let end = own.end();
        assert_eq!(end.status.code(), Some(0), "{cut}: {end:?}");
        let resumed = fs::read_to_string(&journal).expect("a journal");
        assert!(resumed.lines().count() > cut, "{cut}: nothing was added");
    }
}
