//! HTTP interface of a run that ends with its goal: that of an executive, without further goals.

use serde_json::{Value, json};

use super::client::{Executive, TOKEN, folder, write_token};
use super::{DOMAIN, PROBLEM};

const LINE: [&str; 4] = [DOMAIN, PROBLEM, "--realtime", "1"];

fn is_executing(state: &Value) -> bool {
    state["activity"] == "executing"
}

#[test]
fn run_and_executive_answer_the_same_paths() {
    let place = folder("single-same");
    let token = write_token(&place);
    let run = Executive::single_run(&place, &[&LINE[..], &["--token", &token]].concat());
    let executive = Executive::start(&folder("single-other"), &LINE);
    for own in [&run, &executive] {
        own.await_state(is_executing);
    }
    for (verb, path) in [
        ("GET", "/"),
        ("GET", "/run"),
        ("GET", "/document"),
        ("GET", "/v1/state"),
        ("GET", "/v1/goals"),
        ("GET", "/v1/plan"),
        ("GET", "/v1/guarantee"),
        ("GET", "/v1/next"),
        ("GET", "/v1/openapi.json"),
        ("GET", "/v1/events?after=x"),
        ("GET", "/nothing"),
        ("GET", "/stop"),
        ("GET", "/v1/stop"),
        ("GET", "/v1/goals/problem"),
        ("PUT", "/"),
        ("POST", "/document"),
        ("POST", "/v1/state"),
        ("DELETE", "/v1/goals/nothing"),
    ] {
        let [one, other] = [&run, &executive].map(|own| own.ask(verb, path, Some(TOKEN), ""));
        assert_eq!(one.0, other.0, "{verb} {path}: {} {}", one.1, other.1);
        if one.0 != 200 {
            assert!(one.1["error"].is_string(), "{verb} {path}: {}", one.1);
            assert_eq!(one.1, other.1, "{verb} {path}");
        }
    }
    for path in ["/stop", "/pause", "/cancel", "/v1/stop", "/v1/goals"] {
        for token in [None, Some("another-token-of-some-length")] {
            let both = [&run, &executive].map(|own| own.ask("POST", path, token, ""));
            assert_eq!(both[0], both[1], "{path}");
            assert_eq!(both[0].0, 401, "{path}");
        }
    }
}

#[test]
fn run_refuses_other_goals_and_can_be_paused_and_cancelled() {
    let place = folder("single-goal");
    let token = write_token(&place);
    let mut own = Executive::single_run(&place, &[&LINE[..], &["--token", &token]].concat());
    own.await_state(is_executing);
    for (verb, path, body) in [
        ("POST", "/v1/goals", json!({"goal": "(done a1)"})),
        ("POST", "/v1/facts", json!({"fact": "(done a1)"})),
        ("POST", "/v1/numbers", json!({"fluent": "(x)", "value": 1})),
        ("PUT", "/v1/problem", json!({"problem": "(define"})),
    ] {
        let (status, refusal) = own.ask(verb, path, Some(TOKEN), &body.to_string());
        assert_eq!(status, 409, "{path}: {refusal}");
        let error = refusal["error"].as_str().expect("a reason");
        assert!(error.contains("one goal"), "{path}: {refusal}");
    }
    assert_eq!(own.post("/v1/pause", &Value::Null).0, 200);
    own.await_state(|state| state["activity"] == "paused");
    assert_eq!(own.post("/resume", &Value::Null).0, 202);
    own.await_state(is_executing);
    assert_eq!(own.delete("/v1/goals/problem").0, 200);
    assert_eq!(own.end().status.code(), Some(130));
}

#[test]
fn run_without_token_can_only_be_read() {
    let own = Executive::single_run(&folder("single-read"), &LINE);
    own.await_state(is_executing);
    for path in ["/stop", "/v1/stop", "/v1/pause", "/v1/goals"] {
        assert_eq!(own.post(path, &Value::Null).0, 403, "{path}");
    }
}
