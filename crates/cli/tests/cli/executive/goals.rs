//! Several goals at once, clients that wait for a goal, and requests about single actions.

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{command, ctl, python_is_there, simulated, with_robot};

/// Submits a goal with `ctl goal --wait`. Returns the exit code and the state of the goal.
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
    let past = json!({"goal": "(done b2)", "deadline": 0});
    let (_, refusal) = own.post("/v1/goals", &past);
    let refusal = refusal.to_string();
    assert!(
        refusal.contains("the deadline has passed: the time is") && refusal.contains("s later"),
        "{refusal}"
    );
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
fn goals_with_release_times_are_queued_until_then() {
    let own = simulated("released");
    own.await_state(|state| state["activity"] == "resting");
    for (wrong, words) in [
        (json!({"after": 0}), "must be positive"),
        (
            json!({"after": 5, "release": 1_000_000}),
            "leave out one of them",
        ),
        (json!({"after": 5, "deadline": 1_000_000}), "give both"),
        (
            json!({"after": 5, "within": 5}),
            "not later than the release time",
        ),
        (
            json!({"release": 1e6, "deadline": 1e6}),
            "not later than the release time",
        ),
        (json!({"release": "soon"}), "number"),
        (json!({"by": ""}), "invalid name of a client"),
        (json!({"by": "a\nb"}), "invalid name of a client"),
    ] {
        let mut goal = wrong.clone();
        goal["goal"] = json!("(done b2)");
        let (status, refusal) = own.post("/v1/goals", &goal);
        assert_eq!(status, 422, "{wrong}: {refusal}");
        assert!(refusal.to_string().contains(words), "{wrong}: {refusal}");
    }
    let (token, address) = (own.token(), own.address());
    let executive = ["--token", &token, "--to", &address];
    let later = [
        "goal",
        "(not (open a1))",
        "--name",
        "later",
        "--release",
        "1000000",
        "--by",
        "ward 3",
    ];
    let told = ctl(&[&executive[..], &later].concat());
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let (status, goal) = own.get("/v1/goals/later");
    assert_eq!((status, &goal["state"]), (200, &json!("queued")), "{goal}");
    assert_eq!(goal["release"]["exact"], "1000000", "{goal}");
    assert_eq!(goal["by"], "ward 3", "{goal}");
    let gone = json!({"goal": "(not (open a1))", "name": "gone"});
    assert_eq!(own.post("/v1/goals", &gone).0, 200);
    assert_eq!(own.delete("/v1/goals/gone").0, 200);
    own.await_state(|state| state["why"] == "the next goal is released at 1000000");
    let shown = |command: &str| {
        let told = ctl(&[&executive[..], &[command]].concat());
        String::from_utf8_lossy(&told.stdout).replace("\n  ", " ")
    };
    let words = "later, from 1000000, given by ward 3: queued since";
    assert!(shown("goals").contains(words), "{}", shown("goals"));
    assert!(
        shown("state").contains("; queued until 1000000"),
        "{}",
        shown("state")
    );
    let soon = [
        "goal",
        "(done b2)",
        "--name",
        "soon",
        "--after",
        "0.5",
        "--wait",
        "--json",
    ];
    let told = ctl(&[&executive[..], &soon].concat());
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let goal: Value = serde_json::from_slice(&told.stdout).expect("a document");
    assert_eq!(goal["state"], "achieved", "{goal}");
    let lines = own.trace_lines();
    let released = lines.iter().find(|it| it["becomes"] == "released");
    assert_eq!(released.expect("a line")["name"], "soon");
    let given = lines.iter().filter_map(|it| it["observations"].as_array());
    let given = given.flatten().find(|it| it["name"] == "later");
    assert_eq!(given.expect("an observation")["by"], "ward 3");
    assert_eq!(own.get("/v1/goals/none").0, 404);
    assert_eq!(own.delete("/v1/goals/later").0, 200);
    let (_, goal) = own.get("/v1/goals/later");
    assert_eq!(goal["state"], "cancelled", "{goal}");
}

/// Goals that were closed before a rotation of the journal are listed after a crash.
#[test]
fn closed_and_queued_goals_survive_rotation_and_crash() {
    if !python_is_there() {
        return;
    }
    let place = folder("closed-goals");
    let journal = place.join("journal").display().to_string();
    let line = with_robot(&place, &journal);
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    let segments = ["--journal-size", "1K", "--journal-segments", "1000"];
    let mut own = Executive::start(&place, &[&line[..], &segments].concat());
    own.await_state(|state| state["why"] == "reached: problem");
    let later = json!({"name": "later", "goal": "(done a1)", "after": 1_000_000, "by": "night"});
    assert_eq!(own.post("/v1/goals", &later).0, 200);
    let is_carried_over = || {
        let text = std::fs::read_to_string(&journal).expect("a journal");
        let second = text.lines().nth(1).unwrap_or_default();
        second.contains("\"closed\"") && second.contains("\"problem\"") && second.contains("night")
    };
    let mut given = 0;
    for number in 0.. {
        given = number + 1;
        // The journal is rotated when its length has doubled.
        assert!(number < 200, "the journal is not rotated");
        let goal = json!({"name": format!("more-{number}"), "goal": "(done a2)"});
        assert_eq!(own.post("/v1/goals", &goal).0, 200);
        own.await_state(|state| state["goals"].as_array().is_some_and(|it| it.len() == 1));
        if is_carried_over() {
            break;
        }
    }
    let before = own.get("/v1/goals/problem");
    assert_eq!(before.1["state"], "achieved", "{before:?}");
    own.kill();
    let own = Executive::start(&place, &["--resume", &journal]);
    own.await_state(|state| state["activity"] == "resting");
    assert_eq!(own.get("/v1/goals/problem"), before);
    let (_, goal) = own.get("/v1/goals/later");
    assert_eq!(
        (&goal["state"], &goal["by"]),
        (&json!("queued"), &json!("night")),
        "{goal}"
    );
    assert!(goal["given"]["decimal"].is_number(), "{goal}");
    assert_history(&own, given);
    let replayed = command::elbowroom(&["run", "--replay", &journal]);
    assert_eq!(replayed.status.code(), Some(0), "{replayed:?}");
    std::fs::remove_dir_all(&place).expect("the folder is there");
}

/// Checks that the pages of the history have the goal of the problem, `more` other goals, and all actions, each once and
/// the latest first.
fn assert_history(own: &Executive, more: usize) {
    let (mut goals, mut tickets, mut latest) = (Vec::new(), Vec::new(), f64::INFINITY);
    let mut path = "/v1/history?limit=3".to_owned();
    loop {
        let (status, page) = own.get(&path);
        assert_eq!(status, 200, "{page}");
        let (closed, ended) = (page["goals"].as_array(), page["actions"].as_array());
        let times = closed.into_iter().flatten().map(|it| &it["since"]);
        let times = times.chain(ended.into_iter().flatten().map(|it| &it["end"]));
        let times: Vec<f64> = times.map(super::exact).collect();
        assert!(times.iter().all(|time| *time < latest), "{latest}: {page}");
        latest = times.into_iter().fold(latest, f64::min);
        goals.extend(closed.into_iter().flatten().map(|it| it["name"].clone()));
        tickets.extend(
            ended
                .into_iter()
                .flatten()
                .map(|it| it["ticket"].as_u64().expect("a ticket")),
        );
        let Some(next) = page["next"]["exact"].as_str() else {
            break;
        };
        path = format!("/v1/history?limit=3&before={next}");
    }
    let mut expected: Vec<Value> = (0..more)
        .map(|number| json!(format!("more-{number}")))
        .collect();
    expected.push(json!("problem"));
    goals.sort_by_key(Value::to_string);
    expected.sort_by_key(Value::to_string);
    assert_eq!(goals, expected);
    tickets.sort_unstable();
    let all: Vec<u64> = (0..tickets.len() as u64).collect();
    assert!(tickets.len() >= 6 && tickets == all, "{tickets:?}");
    let told = ctl(&["--to", &own.address(), "history", "--limit", "1000"]);
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(
        text.contains("more-0: achieved") && text.contains("(do "),
        "{text}"
    );
    for wrong in ["limit=0", "limit=1001", "before=soon", "after=1"] {
        assert_eq!(own.get(&format!("/v1/history?{wrong}")).0, 422);
    }
}

#[test]
fn goals_to_keep_are_given_by_the_command() {
    let own = simulated("keep");
    let (token, address) = (own.token(), own.address());
    let line = ["goal", "(done a1)", "--name", "always", "--keep", "--wait"];
    let told = ctl(&[&line[..], &["--token", &token, "--to", &address]].concat());
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    let text = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(text.contains("always, to be kept: kept since"), "{text}");
    // When the fact is reported to be lost, it cannot be achieved again: the errand is no longer open.
    assert_eq!(
        own.post("/v1/facts", &json!({"fact": "(open a1)", "becomes": false}))
            .0,
        200
    );
    assert_eq!(
        own.post("/v1/facts", &json!({"fact": "(done a1)", "becomes": false}))
            .0,
        200
    );
    own.await_state(|state| {
        let goals = state["goals"].as_array().expect("goals");
        let kept = goals.iter().find(|goal| goal["name"] == "always");
        kept.is_some_and(|goal| goal["keep"] != "kept")
    });
    let deadline = ctl(&["goal", "(done a1)", "--keep", "--within", "5"]);
    assert_eq!(deadline.status.code(), Some(2), "{deadline:?}");
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

#[test]
fn missed_deadline_reports_the_lateness() {
    let own = simulated("late");
    own.await_state(|state| state["activity"] == "resting");
    assert_eq!(
        own.post("/v1/facts", &json!({"fact": "(done a3)", "becomes": false}))
            .0,
        200
    );
    // An errand takes two seconds.
    let goal = json!({"name": "soon", "goal": "(done a3)", "within": 1.5});
    assert_eq!(own.post("/v1/goals", &goal).0, 200);
    let mut goal = Value::Null;
    while goal["state"] != "failed" {
        let (_, all) = own.get("/v1/goals");
        let goals = all["goals"].as_array().expect("goals");
        goal = goals
            .iter()
            .find(|it| it["name"] == "soon")
            .cloned()
            .unwrap_or_default();
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let why = goal["why"].as_str().expect("a reason");
    assert!(why.contains("s late: it cannot be reached before"), "{why}");
    let told = ctl(&["--to", &own.address(), "goals"]);
    assert!(
        String::from_utf8_lossy(&told.stdout).contains("s late"),
        "{told:?}"
    );
    let lines = own.trace_lines();
    let failed = lines
        .iter()
        .find(|it| it["becomes"] == "failed")
        .expect("a line");
    assert_eq!(failed["why"], goal["why"], "{failed}");
}

#[test]
fn goals_that_exclude_each_other_are_named() {
    let roads = "crates/cli/tests/files/two-roads";
    let (domain, problem) = (format!("{roads}/domain.pddl"), format!("{roads}/day.pddl"));
    let line = [&domain, &problem, "--realtime", "10"];
    let own = Executive::start(&folder("conflict"), &line);
    own.await_state(|state| state["activity"] == "resting");
    let conflict = json!({"name": "odd", "goal": "(and (signed) (home) (there))"});
    assert_eq!(own.post("/v1/goals", &conflict).0, 200);
    let is_about_it = |state: &Value| state["why"].as_str().is_some_and(|why| why.contains("odd"));
    let state = own.await_state(|state| state["activity"] == "resting" && is_about_it(state));
    let why = state["why"].as_str().expect("a reason");
    assert!(
        why.contains("`(home)` and `(there)` exclude each other"),
        "{why}"
    );
}

#[test]
fn hypothetical_goals_are_answered_and_not_given() {
    let own = simulated("what-if");
    own.await_state(|state| state["activity"] == "resting");
    let (credentials, address) = (own.token(), own.address());
    let executive = ["--token", &credentials, "--to", &address];
    let ask = |question: &[&str]| ctl(&[&["what-if"], &executive[..], question].concat());
    let told = ask(&["(not (open a1))"]);
    assert_eq!(told.status.code(), Some(1), "{told:?}");
    assert!(told.stdout.starts_with(b"impossible"), "{told:?}");
    let told = ask(&["(done a1)"]);
    assert_eq!(told.status.code(), Some(0), "{told:?}");
    assert!(told.stdout.starts_with(b"done at "), "{told:?}");
    let before = own.get("/v1/goals");
    let (status, answer) = own.post("/v1/what-if", &json!({"goal": "(done b2)", "within": 100}));
    assert_eq!(
        (status, &answer["verdict"]),
        (200, &json!("achieved")),
        "{answer}"
    );
    for wrong in [
        json!({"goal": "(done"}),
        json!({"goal": "(done b2)", "keep": true}),
        json!({"goal": "(done b2)", "within": -1}),
        json!({"goal": "(done b2)", "color": 1}),
    ] {
        let (status, refusal) = own.post("/v1/what-if", &wrong);
        assert_eq!(status, 422, "{wrong}: {refusal}");
    }
    let (status, _) = own.ask("POST", "/v1/what-if", None, r#"{"goal":"(done b2)"}"#);
    assert_eq!(status, 401);
    assert_eq!(before, own.get("/v1/goals"));
    let (_, taken) = own.post("/v1/goals", &json!({"goal": "(done b2)"}));
    assert_eq!(taken["name"], "goal-1", "{taken}");
}
