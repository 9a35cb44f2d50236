//! Behaviour of an executive during planning. The planner waits for a file, so tests control the
//! duration of the search.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{DOMAIN, PROBLEM};

/// Starts an executive whose planner waits for the file `go` in that folder.
fn with_a_slow_planner(place: &Path) -> Executive {
    with_a_slow_planner_for(place, PROBLEM)
}

fn with_a_slow_planner_for(place: &Path, problem: &str) -> Executive {
    let (script, go, once) = (
        place.join("planner.sh"),
        place.join("go"),
        place.join("once"),
    );
    let own = env!("CARGO_BIN_EXE_elbowroom");
    // With the file `once`, each `go` permits one plan.
    let program = format!(
        "while ! test -e '{go}'; do sleep 0.05; done\nif test -e '{once}'; then rm '{go}'; fi\n\
         exec '{own}' plan \"$1\" \"$2\"\n",
        go = go.display(),
        once = once.display()
    );
    fs::write(&script, program).expect("written");
    let command = format!("sh {} {{domain}} {{problem}}", script.display());
    let line = [DOMAIN, problem, "--realtime", "2", "--planner", &command];
    Executive::start(place, &line)
}

fn is_planning(state: &Value) -> bool {
    state["activity"] == "planning"
}

fn has_reached_all(state: &Value) -> bool {
    state["goals"] == json!([]) && state["activity"] == "resting"
}

#[test]
fn requests_are_answered_during_first_planning() {
    let place = folder("first-search");
    let mut own = with_a_slow_planner(&place);
    let there_is_none = json!("there is no plan yet");
    let state = own.await_state(is_planning);
    assert_eq!(state["why"], there_is_none, "{state}");
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
    let state = own.await_state(|state| state["activity"] == "paused");
    assert_eq!(state["why"], there_is_none, "{state}");
    own.post("/v1/resume", &Value::Null);
    own.await_state(is_planning);
    fs::write(place.join("go"), "").expect("written");
    own.await_state(has_reached_all);
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
}

/// Adds another chain of errands. The problem's own goal does not need them, so a new plan is
/// required for them.
fn with_another_chain(place: &Path) -> String {
    let text = fs::read_to_string(super::command::root().join(PROBLEM)).expect("a problem");
    let text = text
        .replace("b1 b2 b3 - errand", "b1 b2 b3 c1 c2 - errand")
        .replace("(open a1)", "(open c1) (open c2) (open a1)")
        .replace(
            "(first nothing a1)",
            "(first nothing c1) (first c1 c2) (first nothing a1)",
        );
    let problem = place.join("problem.pddl");
    fs::write(&problem, text).expect("written");
    problem.display().to_string()
}

/// Returns the lines of the trace so far, without an incomplete last one.
fn trace(place: &Path) -> Vec<Value> {
    let text = fs::read_to_string(place.join("trace.jsonl")).unwrap_or_default();
    let lines = text.lines().map(serde_json::from_str);
    lines.filter_map(Result::ok).collect()
}

fn is_event(line: &Value, event: &str) -> bool {
    line["event"] == event
}

fn is_start(line: &Value) -> bool {
    is_event(line, "command") && line["command"]["type"] == "start"
}

/// Returns the lines since the last request for a plan, if the search is still running.
fn lines_since_search(lines: &[Value]) -> Option<&[Value]> {
    let asked = lines.iter().rposition(|it| is_event(it, "planning"))?;
    let since = &lines[asked..];
    (!since.iter().any(|it| is_event(it, "planned"))).then_some(since)
}

/// The new goal is not reached by the running plan, so another plan is needed (a goal that it
/// reaches would not cause a search). While the slow planner searches, the running plan is
/// dispatched and requests are answered. The goal is added before there is a plan, so that no
/// action of that plan has started when the next search begins, even on a slow machine.
#[test]
fn current_plan_is_dispatched_during_slow_planning() {
    let place = folder("dispatched-meanwhile");
    let (go, once) = (place.join("go"), place.join("once"));
    fs::write(&once, "").expect("written");
    let problem = with_another_chain(&place);
    let mut own = with_a_slow_planner_for(&place, &problem);
    own.await_state(is_planning);
    let goal = json!({"goal": "(done c2)", "name": "more"});
    assert_eq!(own.post("/v1/goals", &goal).0, 200);
    fs::write(&go, "").expect("written");
    // All starts belong to the earlier plan.
    let state = own.await_state(|state| {
        let lines = trace(&place);
        let plans = lines.iter().filter(|it| is_event(it, "plan")).count();
        let has_started = lines_since_search(&lines).is_some_and(|it| it.iter().any(is_start));
        plans == 1 && has_started && is_planning(state)
    });
    assert_eq!(
        state["goals"].as_array().expect("goals").len(),
        2,
        "{state}"
    );
    for path in ["/v1/plan", "/v1/guarantee", "/v1/next"] {
        assert_eq!(own.get(path).0, 200, "{path}");
    }
    let fact = json!({"fact": "(done b3)", "becomes": true});
    assert_eq!(own.post("/v1/facts", &fact).1["taken"], json!(true));
    own.await_state(|_| {
        let lines = trace(&place);
        let heard = |it: &Value| is_event(it, "observed") && it["observation"]["type"] == "fact";
        lines_since_search(&lines).is_some_and(|it| it.iter().any(heard))
    });
    fs::remove_file(&once).expect("it is there");
    fs::write(&go, "").expect("written");
    own.await_state(has_reached_all);
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
    fs::remove_dir_all(&place).expect("the folder is there");
}

/// A domain that cannot be executed is refused before the executive listens for a problem.
#[test]
fn unsupported_domain_is_rejected_before_listening() {
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
