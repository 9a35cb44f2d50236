//! Actions that hang.

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{command, ctl, python_is_there};

const FILES: [&str; 2] = [
    "crates/cli/tests/files/hanging/domain.pddl",
    "crates/cli/tests/files/hanging/problem.pddl",
];

fn world(kind: &str) -> String {
    format!("python3 crates/cli/tests/files/hanging/world.py {kind}")
}

#[test]
fn goal_is_reached_although_the_first_action_hangs() {
    if !python_is_there() {
        return;
    }
    for kind in ["", "stuck"] {
        let world = world(kind);
        for executor in elbowroom::execution::executors::EXECUTORS {
            let executor = executor.example();
            let line = ["--executor", &executor, "--world-process", &world];
            let run = command::elbowroom(&[&["run"], &FILES[..], &line[..]].concat());
            assert_eq!(run.status.code(), Some(0), "{executor}, {kind}: {run:?}");
        }
        let place = folder(&format!("hanging{kind}"));
        let line = ["--world-process", &world];
        let own = Executive::start(&place, &[&FILES[..], &line[..]].concat());
        own.await_state(|state| state["why"] == "reached: problem");
    }
}

#[test]
fn doubt_is_listed_and_settled_by_a_fact() {
    if !python_is_there() {
        return;
    }
    let (place, world) = (folder("deaf"), world("deaf"));
    let line = ["--world-process", &world];
    let mut own = Executive::start(&place, &[&FILES[..], &line[..]].concat());
    let state = own.await_state(|state| state["activity"] == "resting");
    let doubts = state["in_doubt"].as_array().expect("doubts");
    let names = doubts.iter().map(|doubt| &doubt["name"]);
    assert_eq!(
        names.collect::<Vec<_>>(),
        ["(waiting box)", "(loaded box)"],
        "{state}"
    );
    let why = state["why"].as_str().expect("words");
    assert!(why.contains("therefore in doubt: (waiting box)"), "{why}");
    assert_eq!(state["facts"], json!([]), "{state}");
    let shown = ctl(&["--to", &own.address(), "state"]);
    let shown = String::from_utf8_lossy(&shown.stdout).into_owned();
    assert!(shown.contains("(waiting box) is in doubt since"), "{shown}");
    assert!(shown.contains("`ctl fact '(waiting box)'`"), "{shown}");
    let fact = json!({"fact": "(waiting box)", "becomes": true});
    let (status, answer) = own.post("/v1/facts", &fact);
    assert_eq!(status, 200, "{answer}");
    let state = own.await_state(|state| state["why"] == "reached: problem");
    assert_eq!(state["in_doubt"], json!([]), "{state}");
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
}
