//! Several goals at once, clients that wait for one, and requests about single actions.

use serde_json::{Value, json};

use super::client::Executive;
use super::{ctl, simulated};

/// Gives a goal with `ctl goal --wait`. Returns the exit code and the state of the goal.
fn wait_for(own: &Executive, name: &str, goal: &str) -> (Option<i32>, Value) {
    let (token, address) = (own.token(), own.address());
    let executive = ["--token", &token, "--to", &address, "--json"];
    let told = ctl(&[&executive[..], &["goal", goal, "--name", name, "--wait"]].concat());
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    let goal: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{told:?}"));
    (told.status.code(), goal["state"].clone())
}

#[test]
fn each_goal_has_a_state_and_can_be_waited_for() {
    let own = simulated("goals");
    let never = json!({"goal": "(not (done nothing))", "name": "never"});
    assert_eq!(own.post("/v1/goals", &never).0, 200);
    let more = wait_for(&own, "more", "(done b2)");
    assert_eq!(more, (Some(0), json!("achieved")));
    own.await_state(|state| state["activity"] == "resting");
    let (status, all) = own.get("/v1/goals");
    assert_eq!(status, 200, "{all}");
    let goals = all["goals"].as_array().expect("goals");
    let state = |name: &str| {
        let goal = goals.iter().find(|goal| goal["name"] == name);
        goal.map_or(Value::Null, |goal| goal["state"].clone())
    };
    assert_eq!(state("problem"), "achieved", "{all}");
    assert_eq!(state("never"), "impossible", "{all}");
    let nor = wait_for(&own, "nor", "(not (open a1))");
    assert_eq!(nor.0, Some(1), "{nor:?}");
    let told = ctl(&["--to", &own.address(), "goals"]);
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(text.contains("never: impossible since"), "{text}");
}

#[test]
fn values_are_positive_numbers() {
    let own = simulated("values");
    own.await_state(|state| state["activity"] == "resting");
    for value in [json!(0), json!(-1), json!("0"), json!("much"), json!([])] {
        let goal = json!({"goal": "(done a1)", "value": value});
        let (status, refusal) = own.post("/v1/goals", &goal);
        assert_eq!(status, 422, "{value}: {refusal}");
    }
    let goal = json!({"goal": "(done a1)", "value": "5/2"});
    assert_eq!(own.post("/v1/goals", &goal).0, 200);
}

#[test]
fn goals_with_deadlines_are_achieved_or_fail() {
    let own = simulated("deadlines");
    own.await_state(|state| state["activity"] == "resting");
    for (extra, wrong) in [
        ("within", json!(0)),
        ("within", json!(-2)),
        ("deadline", json!("1/1000000")),
        ("deadline", json!("soon")),
    ] {
        let goal = json!({"goal": "(done b2)", extra: wrong});
        let (status, refusal) = own.post("/v1/goals", &goal);
        assert_eq!(status, 422, "{goal}: {refusal}");
    }
    let both = json!({"goal": "(done b2)", "within": 5, "deadline": 1_000_000});
    assert_eq!(own.post("/v1/goals", &both).0, 422);
    let late = ("soon", "(not (open a1))", "0.001", (1, "failed"));
    let in_time = ("later", "(done b2)", "100000", (0, "achieved"));
    for (name, goal, seconds, (code, state)) in [late, in_time] {
        let (token, address) = (own.token(), own.address());
        let executive = ["--token", &token, "--to", &address, "--json"];
        let goal = ["goal", goal, "--name", name, "--within", seconds, "--wait"];
        let told = ctl(&[&executive[..], &goal].concat());
        let text = String::from_utf8_lossy(&told.stdout).into_owned();
        let answer: Value = serde_json::from_str(&text).unwrap_or_else(|_| panic!("{told:?}"));
        assert_eq!(told.status.code(), Some(code), "{text}");
        assert_eq!(answer["state"], state, "{text}");
    }
}

#[test]
fn operators_report_and_cancel_running_actions() {
    let own = simulated("operators");
    let mut reported = Vec::new();
    for becomes in ["failed", "cancelled", "done"] {
        let is_new = |state: &Value| {
            let ticket = state["running"][0]["ticket"].as_u64();
            ticket.is_some_and(|ticket| !reported.contains(&ticket))
        };
        let state = own.await_state(is_new);
        let ticket = state["running"][0]["ticket"].as_u64().expect("a ticket");
        let outcome = json!({"ticket": ticket, "becomes": becomes});
        let (status, answer) = own.post("/v1/actions", &outcome);
        assert_eq!(status, 200, "{answer}");
        reported.push(ticket);
    }
    let (status, answer) = own.post("/v1/actions", &json!({"ticket": 99, "becomes": "done"}));
    assert_eq!(status, 404, "{answer}");
    let (status, answer) = own.post("/v1/actions", &json!({"ticket": 0, "becomes": "lost"}));
    assert_eq!(status, 422, "{answer}");
    own.await_state(|state| state["activity"] == "resting");
    let (_, all) = own.get("/v1/goals");
    assert_eq!(all["goals"][0]["state"], "achieved", "{all}");
}
