//! `elbowroom serve` and `elbowroom ctl`, over real sockets.

#![cfg(unix)]

mod asked;
mod client;
mod doubts;
mod faults;
mod first;
mod goals;
mod hostile;
mod killed;
mod learning;
mod meanwhile;
mod recorded;
mod single_run;

use crate::command;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::Duration;

use crate::robots::{check_tickets, lines, python_is_there};
use client::{Executive, TOKEN, folder};
use serde_json::{Value, json};

const DOMAIN: &str = "crates/cli/tests/files/errands/domain.pddl";
const PROBLEM: &str = "crates/cli/tests/files/errands/problem.pddl";

/// Starts an executive in a simulation at ten times real time. An errand takes 0.2 s.
fn simulated(name: &str) -> Executive {
    Executive::start(&folder(name), &[DOMAIN, PROBLEM, "--realtime", "10"])
}

fn ctl(line: &[&str]) -> Output {
    command::elbowroom(&[&["ctl"], line].concat())
}

fn exact(number: &Value) -> f64 {
    number["decimal"].as_f64().expect("a number")
}

#[test]
fn executive_pursues_goals_until_it_is_stopped() {
    let mut own = simulated("nominal");
    own.await_state(|state| state["why"] == "reached: problem");
    let (status, taken) = own.post("/v1/facts", &json!({"fact": "(done a3)", "becomes": false}));
    assert_eq!((status, &taken["taken"]), (200, &json!(true)), "{taken}");
    let (status, taken) = own.post("/v1/goals", &json!({"goal": "(done a3)"}));
    assert_eq!((status, &taken["name"]), (200, &json!("goal-1")), "{taken}");
    let state = own.await_state(|state| state["why"] == "reached: goal-1");
    assert!(
        state["facts"]
            .as_array()
            .expect("facts")
            .contains(&json!("(done a3)")),
        "{state}"
    );
    assert_eq!(state["activity"], "resting");
    let (status, _) = own.post("/v1/stop", &Value::Null);
    assert_eq!(status, 200);
    let output = own.end();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        text.contains("(do r a2 a3)") || text.contains("(do s a2 a3)"),
        "{text}"
    );
}

#[test]
fn socket_and_http_give_the_same_answers() {
    let own = simulated("alike");
    own.await_state(|state| state["activity"] == "resting");
    for path in [
        "/v1/state",
        "/v1/plan",
        "/v1/guarantee",
        "/v1/next",
        "/v1/openapi.json",
    ] {
        let (one, other) = (own.get(path), own.get_by_socket(path));
        assert_eq!(one.0, 200, "{path}");
        let without_time = |mut it: Value| {
            it["now"] = Value::Null;
            it
        };
        assert_eq!(without_time(one.1), without_time(other.1), "{path}");
    }
    for to in [own.address(), own.socket()] {
        let state = ctl(&["--to", &to, "state", "--json"]);
        let state: Value = serde_json::from_slice(&state.stdout).expect("JSON");
        assert_eq!(state["activity"], "resting");
        for what in ["state", "plan", "guarantee", "next"] {
            let told = ctl(&["--to", &to, what]);
            assert!(
                told.status.success() && !told.stdout.is_empty(),
                "{what}: {told:?}"
            );
        }
    }
}

#[test]
fn changes_during_the_run_are_respected() {
    let own = Executive::start(&folder("changed"), &[DOMAIN, PROBLEM, "--realtime", "2"]);
    let two = |state: &Value| state["running"].as_array().is_some_and(|it| it.len() == 2);
    own.await_state(two);
    // One chain was done by others, and the other one gets another goal.
    let told = |line: &[&str]| {
        let done = ctl(&[&["--token", &own.token(), "--to", &own.address()], line].concat());
        assert!(done.status.success(), "{line:?}: {done:?}");
    };
    told(&["fact", "(done b3)"]);
    told(&["goal", "(done a2)", "--name", "second"]);
    told(&["cancel", "problem"]);
    let state = own.await_state(|state| state["why"] == "reached: second");
    let facts = state["facts"].as_array().expect("facts");
    assert!(facts.contains(&json!("(done a2)")));
    assert!(!facts.contains(&json!("(done a3)")), "{state}");
    assert!(!facts.contains(&json!("(done b2)")), "{state}");
}

/// An accepted request is visible in every later answer.
#[test]
fn accepted_request_affects_the_next_one() {
    let own = simulated("at-once");
    own.await_state(|state| state["activity"] != "beginning");
    // Paused, so that no goal is reached in the meantime.
    assert_eq!(own.post("/v1/pause", &Value::Null).0, 200);
    for _ in 0..20 {
        let (status, answer) = own.post("/v1/goals", &json!({"name": "x", "goal": "(done a3)"}));
        assert_eq!((status, &answer["name"]), (200, &json!("x")), "{answer}");
        let deleted = [(); 2].map(|()| own.delete("/v1/goals/x"));
        assert_eq!([deleted[0].0, deleted[1].0], [200, 404], "{deleted:?}");
    }
}

#[test]
fn paused_executive_starts_nothing() {
    let own = Executive::start(&folder("pause"), &[DOMAIN, PROBLEM, "--realtime", "10"]);
    // An action commanded before the pause starts during it.
    own.await_state(|state| state["running"].as_array().is_some_and(|it| it.len() == 2));
    let (status, answer) = own.post("/v1/pause", &Value::Null);
    assert_eq!(status, 200, "{answer}");
    let state = own.await_state(|state| state["running"].as_array().is_some_and(Vec::is_empty));
    assert_eq!(state["activity"], "paused");
    let done = state["facts"].clone();
    std::thread::sleep(Duration::from_millis(600));
    assert_eq!(own.get("/v1/state").1["facts"], done);
    own.post("/v1/resume", &Value::Null);
    own.await_state(|state| state["why"] == "reached: problem");
}

#[test]
fn executive_without_plan_reports_reason_and_waits() {
    let own = simulated("stuck");
    own.await_state(|state| state["activity"] == "resting");
    own.post("/v1/facts", &json!({"fact": "(done a3)", "becomes": false}));
    own.post("/v1/facts", &json!({"fact": "(open a3)", "becomes": false}));
    own.post("/v1/goals", &json!({"name": "third", "goal": "(done a3)"}));
    let state = own.await_state(|state| {
        state["why"]
            .as_str()
            .is_some_and(|why| why.contains("no plan reaches the goals"))
    });
    let why = state["why"].as_str().expect("words");
    assert!(why.contains("third") && why.contains("(done a3)"), "{why}");
    let (_, next) = own.get("/v1/next");
    assert_eq!(next["why"], state["why"]);
    own.post("/v1/facts", &json!({"fact": "(open a3)", "becomes": true}));
    own.await_state(|state| state["why"] == "reached: third");
}

#[test]
fn executive_without_problem_waits_for_one() {
    let own = Executive::start(&folder("problem"), &[DOMAIN, "--realtime", "10"]);
    let (status, state) = own.get("/v1/state");
    assert_eq!(
        (status, &state["activity"]),
        (200, &json!("beginning")),
        "{state}"
    );
    let (status, refusal) = own.post("/v1/goals", &json!({"goal": "(done a1)"}));
    assert_eq!(status, 409, "{refusal}");
    let (status, refusal) = own.page_now();
    assert!(
        status == 409 && refusal.contains("elbowroom ctl problem FILE"),
        "{refusal}"
    );
    let (status, refusal) = own.put("/v1/problem", &json!({"problem": "(define"}));
    assert_eq!(status, 422, "{refusal}");
    let text = fs::read_to_string(command::root().join(PROBLEM)).expect("a problem");
    assert_eq!(own.put("/v1/problem", &json!({"problem": text})).0, 200);
    own.await_state(|state| state["why"] == "reached: problem");
    // The same problem again: all errands are open again.
    assert_eq!(own.put("/v1/problem", &json!({"problem": text})).0, 200);
    let again = |state: &Value| {
        let plans = state["plans"].as_u64().expect("a number");
        plans >= 2 && state["why"] == "reached: problem"
    };
    own.await_state(again);
    let other = text.replace("r s - robot", "r s t - robot");
    let (status, refusal) = own.put("/v1/problem", &json!({"problem": other}));
    assert_eq!(status, 409, "{refusal}");
}

#[test]
fn events_are_the_lines_of_the_trace() {
    let own = simulated("events");
    own.await_state(|state| state["activity"] == "resting");
    let mut stream = TcpStream::connect(own.address()).expect("it listens");
    let request = "GET /v1/events?after=1 HTTP/1.1\r\nHost: localhost\r\n\r\n";
    stream.write_all(request.as_bytes()).expect("written");
    own.post("/v1/stop", &Value::Null);
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("until the end");
    let data = text.lines().filter_map(|line| line.strip_prefix("data: "));
    let lines: Vec<Value> = data
        .map(|it| serde_json::from_str(it).expect("JSON"))
        .collect();
    let kinds: Vec<&str> = lines
        .iter()
        .filter_map(|line| line["event"].as_str())
        .collect();
    for kind in [
        "planning", "plan", "decided", "command", "passed", "observed", "resting", "over",
    ] {
        assert!(kinds.contains(&kind), "{kind}: {kinds:?}");
    }
    let ids: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("id: "))
        .collect();
    assert_eq!(ids.first(), Some(&"2"));
    assert!(text.trim_end().ends_with("event: over\ndata: {}"), "{text}");
}

/// Verb, path, token, body; status and message of the refusal.
type Refused<'a> = (&'a str, &'a str, Option<&'a str>, String, u16, &'a str);

#[test]
#[expect(clippy::too_many_lines, reason = "a table of refusals")]
fn unauthorized_or_invalid_requests_get_a_clear_error() {
    let own = simulated("refused");
    own.await_state(|state| state["activity"] == "resting");
    let goal = json!({"goal": "(done a1)"});
    let tests: &[Refused<'_>] = &[
        (
            "POST",
            "/v1/goals",
            None,
            goal.to_string(),
            401,
            "needs the executive's token",
        ),
        (
            "POST",
            "/v1/goals",
            Some("wrong"),
            goal.to_string(),
            401,
            "wrong token",
        ),
        (
            "POST",
            "/stop",
            None,
            String::new(),
            401,
            "needs the executive's token",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            "{".to_owned(),
            422,
            "cannot parse the body",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            "{\"aim\":1}".to_owned(),
            422,
            "unknown field `aim`",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            "{}".to_owned(),
            422,
            "missing field `goal`",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            json!({"goal": "(done spoon)"}).to_string(),
            422,
            "spoon",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            json!({"goal": "(done a1)", "name": "a/b"}).to_string(),
            422,
            "invalid name of a goal",
        ),
        (
            "POST",
            "/v1/goals",
            Some(TOKEN),
            json!({"goal": "(and (done a1) (not (done r)))"}).to_string(),
            422,
            "the problem has no fact `(done r)`: `r` is not of type errand",
        ),
        (
            "DELETE",
            "/v1/goals/nobody",
            Some(TOKEN),
            String::new(),
            404,
            "there is no open goal with this name",
        ),
        (
            "POST",
            "/v1/facts",
            Some(TOKEN),
            json!({"fact": "(idle a1)", "becomes": true}).to_string(),
            422,
            "no fact `(idle a1)`",
        ),
        (
            "POST",
            "/v1/facts",
            Some(TOKEN),
            json!({"fact": "(idle r)", "becomes": "yes"}).to_string(),
            422,
            "expected a boolean",
        ),
        (
            "POST",
            "/v1/numbers",
            Some(TOKEN),
            json!({"fluent": "(charge r)", "value": 1}).to_string(),
            422,
            "no fluent `(charge r)`",
        ),
        (
            "POST",
            "/v1/numbers",
            Some(TOKEN),
            json!({"fluent": "(charge r)", "value": "much"}).to_string(),
            422,
            "expected a number",
        ),
        (
            "POST",
            "/v1/numbers",
            Some(TOKEN),
            "[]".to_owned(),
            422,
            "expected an object, found a list",
        ),
        (
            "GET",
            "/v1/wishes",
            None,
            String::new(),
            404,
            "unknown path",
        ),
        (
            "PUT",
            "/v1/state",
            Some(TOKEN),
            String::new(),
            405,
            "does not support PUT, but GET",
        ),
        (
            "GET",
            "/v1/pause",
            None,
            String::new(),
            405,
            "does not support GET, but POST",
        ),
        (
            "GET",
            "/v1/events?after=soon",
            None,
            String::new(),
            422,
            "expected a line number in",
        ),
    ];
    for (verb, path, token, body, expected, words) in tests {
        let (status, refusal) = own.ask(verb, path, *token, body);
        assert_eq!(status, *expected, "{verb} {path} {body}: {refusal}");
        let error = refusal["error"].as_str().expect("a sentence");
        assert!(error.contains(words), "{verb} {path} {body}: {error}");
        assert!(!error.contains('\n') && !refusal["help"].as_str().unwrap_or("").is_empty());
    }
    let raw = |text: &[u8]| {
        let mut stream = TcpStream::connect(own.address()).expect("it listens");
        stream.write_all(text).expect("written");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer");
        answer
    };
    let nonsense = raw(b"\x16\x03\x01\x02\r\n\r\n");
    assert!(
        nonsense.contains("400") && nonsense.contains("this is not HTTP"),
        "{nonsense}"
    );
    let foreign = raw(b"GET /v1/state HTTP/1.1\r\nHost: evil.example\r\n\r\n");
    assert!(foreign.contains("403"), "{foreign}");
    let huge =
        raw(b"POST /v1/goals HTTP/1.1\r\nHost: localhost\r\nContent-Length: 99999999\r\n\r\n");
    assert!(
        huge.contains("413") && huge.contains("longer than 4 MB"),
        "{huge}"
    );
    let chunked =
        raw(b"POST /v1/goals HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n");
    assert!(chunked.contains("411"), "{chunked}");
    let slow = raw(b"POST /v1/goals HTTP/1.1\r\nHost: local");
    assert!(slow.contains("408") && slow.contains("5 seconds"), "{slow}");
}

#[test]
fn executive_without_token_is_read_only() {
    let own = Executive::without_token(&folder("open"), &[DOMAIN, PROBLEM, "--realtime", "10"]);
    assert_eq!(own.get("/v1/state").0, 200);
    let (status, refusal) = own.post("/v1/pause", &Value::Null);
    assert_eq!(status, 403, "{refusal}");
    let page = own.page();
    assert!(page.contains("<html") && page.contains("the run"), "{page}");
}

/// Clients that hang, send garbage or do not read do not delay starts.
#[test]
fn bad_clients_cause_no_delay() {
    let own = Executive::start(&folder("bad"), &[DOMAIN, PROBLEM, "--realtime", "1"]);
    let mut held = Vec::new();
    for number in 0..100 {
        let Ok(mut stream) = TcpStream::connect(own.address()) else {
            continue;
        };
        let said: &[u8] = match number % 4 {
            0 => b"GET /v1/st",
            1 => b"POST /v1/goals HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1000000\r\n\r\n{",
            2 => b"GET /v1/events?after=0 HTTP/1.1\r\nHost: localhost\r\n\r\n",
            _ => &[0xff; 5000],
        };
        let _ = stream.write_all(said);
        held.push(stream);
    }
    std::thread::sleep(Duration::from_secs(12));
    drop(held);
    own.await_state(|state| state["why"] == "reached: problem");
    let lines = own.trace_lines();
    let mut starts = 0;
    for line in lines.iter().filter(|line| line["event"] == "command") {
        let earliest = &line["planned"]["earliest"];
        if earliest.is_object() {
            let late = exact(&line["now"]) - exact(earliest);
            assert!(late < 0.5, "{late} s late: {line}");
            starts += 1;
        }
    }
    assert!(starts >= 4, "{starts}");
}

/// Sends a signal to a process, which must exist.
fn signal(process: &str, name: &str) {
    let told = Command::new("kill").args(["-s", name, process]).status();
    assert!(told.expect("every Unix has `kill`").success());
}

fn kill(pid: &str) {
    let _ = Command::new("kill").args(["-9", pid.trim()]).output();
}

fn with_robot(folder: &Path, journal: &str) -> Vec<String> {
    let robot = format!(
        "python3 crates/cli/tests/files/robot.py {}",
        folder.display()
    );
    let line = [
        DOMAIN,
        PROBLEM,
        "--world-process",
        &robot,
        "--journal",
        journal,
    ];
    line.map(str::to_owned).to_vec()
}

/// The executive, alone or with the world, is killed after a goal was submitted and one was
/// cancelled. Goals and pause are kept, and nothing is started twice.
#[test]
fn accepted_requests_survive_kill_9() {
    if !python_is_there() {
        return;
    }
    for (name, world_too) in [("killed", false), ("both-killed", true)] {
        let place = folder(name);
        let journal = place.join("journal").display().to_string();
        let line = with_robot(&place, &journal);
        let line: Vec<&str> = line.iter().map(String::as_str).collect();
        let mut own = Executive::start(&place, &line);
        own.await_state(|state| state["activity"] == "executing");
        let (status, taken) = own.post("/v1/goals", &json!({"name": "mine", "goal": "(done b2)"}));
        assert_eq!((status, &taken["taken"]), (200, &json!(true)), "{taken}");
        assert_eq!(own.delete("/v1/goals/problem").0, 200);
        assert_eq!(own.post("/v1/pause", &Value::Null).0, 200);
        own.kill();
        if world_too {
            kill(&fs::read_to_string(place.join("pid")).expect("a pid"));
        }
        let mut again = Executive::start(&place, &["--resume", &journal]);
        let state = again.await_state(|state| state["activity"] == "paused");
        let goals: Vec<&Value> = state["goals"].as_array().expect("goals").iter().collect();
        assert_eq!(goals.len(), 1, "{state}");
        assert_eq!(goals[0]["name"], "mine");
        assert_eq!(again.post("/v1/resume", &Value::Null).0, 200);
        again.await_state(|state| state["why"] == "reached: mine");
        again.post("/v1/stop", &Value::Null);
        assert_eq!(again.end().status.code(), Some(0));
        let begun = lines(&place, "begun");
        check_tickets(&place, "resumed");
        assert!(
            lines(&place, "done").iter().any(|it| it.contains("b1 b2)")),
            "{begun:?}"
        );
        assert!(!begun.iter().any(|it| it.contains("a2 a3)")), "{begun:?}");
        // The replay of an executive's journal makes the same decisions.
        let replayed = command::elbowroom(&["run", "--replay", &journal]);
        assert_eq!(replayed.status.code(), Some(0), "{replayed:?}");
        let refused = command::elbowroom(&["run", "--resume", &journal]);
        assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    }
}

#[test]
fn wrong_command_line_is_rejected_before_any_effect() {
    let nowhere = PathBuf::from("/nowhere/at/all").display().to_string();
    let tests: [(&[&str], &str); 6] = [
        (&[DOMAIN, PROBLEM, "--http", "99999"], "expected an address"),
        (
            &[DOMAIN, PROBLEM, "--token", &nowhere],
            "cannot read the token",
        ),
        (
            &[DOMAIN, PROBLEM, "--socket", &nowhere, "--http", "0"],
            "cannot listen at /nowhere",
        ),
        (
            &[DOMAIN, PROBLEM, "--world", "spoiler"],
            "cannot run on a wall clock",
        ),
        (&[DOMAIN, PROBLEM, "--executor", "nobody"], "nobody"),
        (&[DOMAIN, PROBLEM, "--replay", &nowhere], "--replay"),
    ];
    for (line, words) in tests {
        let done = command::elbowroom(&[&["serve"], line].concat());
        let said = String::from_utf8_lossy(&done.stderr).into_owned();
        assert_eq!(done.status.code(), Some(2), "{line:?}: {said}");
        assert!(said.contains(words), "{line:?}: {said}");
    }
    let nobody = command::elbowroom(&["ctl", "--to", "127.0.0.1:1", "state"]);
    let said = String::from_utf8_lossy(&nobody.stderr).into_owned();
    assert_eq!(nobody.status.code(), Some(2), "{said}");
    assert!(
        said.contains("cannot reach the executive at 127.0.0.1:1"),
        "{said}"
    );
}
