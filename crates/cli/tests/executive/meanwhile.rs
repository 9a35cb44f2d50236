//! What an executive does while a plan is made. The planner waits for a file, so that a search lasts as
//! long as a test wants it to.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{DOMAIN, PROBLEM};

/// An executive whose planner waits for the file `go` in that folder.
fn with_a_slow_planner(place: &Path) -> Executive {
    let (script, go) = (place.join("planner.sh"), place.join("go"));
    let own = env!("CARGO_BIN_EXE_elbowroom");
    let program = format!(
        "while ! test -e '{}'; do sleep 0.05; done\nexec '{own}' plan \"$1\" \"$2\"\n",
        go.display()
    );
    fs::write(&script, program).expect("written");
    let command = format!("sh {} {{domain}} {{problem}}", script.display());
    let line = [DOMAIN, PROBLEM, "--realtime", "2", "--planner", &command];
    Executive::start(place, &line)
}

fn is_planning(state: &Value) -> bool {
    state["activity"] == "planning"
}

#[test]
fn requests_are_taken_in_and_answered_while_the_first_plan_is_made() {
    let place = folder("first-search");
    let mut own = with_a_slow_planner(&place);
    own.await_state(is_planning);
    for (path, what) in [
        ("/v1/goals", json!({"goal": "(done a2)", "name": "second"})),
        ("/v1/facts", json!({"fact": "(done b3)", "becomes": true})),
        ("/v1/pause", Value::Null),
    ] {
        let (status, taken) = own.post(path, &what);
        assert_eq!(
            (status, &taken["taken"]),
            (200, &json!(true)),
            "{path}: {taken}"
        );
    }
    own.await_state(|state| state["activity"] == "paused");
    own.post("/v1/resume", &Value::Null);
    own.await_state(is_planning);
    fs::write(place.join("go"), "").expect("written");
    own.await_state(|state| state["why"] == "reached: problem, second");
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
}

/// A domain of which nothing can be executed is refused before anybody is asked for a problem.
#[test]
fn a_domain_that_cannot_be_executed_is_refused_before_it_listens() {
    let place = folder("plus");
    let domain = place.join("plus.pddl");
    let text = "(define (domain plus) (:requirements :time :fluents) (:predicates (on)) (:functions (level))
      (:process rises :parameters () :precondition () :effect (increase (level) (* #t 1))))";
    fs::write(&domain, text).expect("written");
    let output = super::command::elbowroom(&[
        "serve",
        &domain.display().to_string(),
        "--http",
        "127.0.0.1:0",
    ]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(
        said.contains("PDDL+") && !said.contains("listening"),
        "{said}"
    );
}
