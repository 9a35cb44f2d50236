//! State and explanations that an executive reports, and its handling of new information.

use std::fs;
use std::net::TcpListener;

use serde_json::{Value, json};

use super::client::{Executive, folder};
use super::{command, ctl, exact, lines, python_is_there, signal, simulated, with_robot};
use crate::skipped::skipped;

/// A hanging program is named, and requests are not reported as waiting for a plan.
#[test]
fn stalled_world_is_reported() {
    if !python_is_there() {
        return;
    }
    let place = folder("still");
    let journal = place.join("journal").display().to_string();
    let line = with_robot(&place, &journal);
    let line: Vec<&str> = line.iter().map(String::as_str).collect();
    let mut own = Executive::start(&place, &line);
    let state = own.await_state(|state| state["activity"] == "executing");
    assert_eq!(state["unanswered"], Value::Null, "{state}");
    assert_eq!(own.get("/v1/ready"), (200, json!("ready\n")));
    let robot = fs::read_to_string(place.join("pid")).expect("a pid");
    signal(&robot, "STOP");
    let state = own.await_state(|state| state["unanswered"].is_u64());
    assert_eq!(state["activity"], "executing", "{state}");
    let (status, why) = own.get("/v1/ready");
    let names_silence = why.as_str().is_some_and(|why| why.contains("not answered"));
    assert!(status == 503 && names_silence, "{status} {why}");
    assert_eq!(own.get("/v1/health"), (200, json!("ok\n")));
    let (status, metrics) = own.get("/metrics");
    let metrics = metrics.as_str().unwrap_or_default();
    assert_eq!(status, 200, "{metrics}");
    for line in [
        "elbowroom_ready 0",
        "elbowroom_activity{activity=\"executing\"} 1",
        "elbowroom_activity{activity=\"resting\"} 0",
        "elbowroom_goals{state=\"pursued\"} 1",
    ] {
        assert!(metrics.lines().any(|it| it == line), "{line}\n{metrics}");
    }
    let (status, answer) = own.post("/v1/pause", &Value::Null);
    assert_eq!((status, &answer["taken"]), (202, &json!(false)), "{answer}");
    let until = answer["until"].as_str().expect("what it waits for");
    assert!(until.starts_with("the world answers, which"), "{until}");
    let told = ctl(&["--to", &own.address(), "state"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains("the world has not answered for"), "{told}");
    signal(&robot, "CONT");
    let state = own.await_state(|state| state["activity"] == "paused");
    assert_eq!(state["unanswered"], Value::Null, "{state}");
    assert_eq!(own.post("/v1/resume", &Value::Null).0, 200);
    own.await_state(|state| state["why"] == "reached: problem");
    own.post("/v1/stop", &Value::Null);
    assert_eq!(own.end().status.code(), Some(0));
    let begun = lines(&place, "begun");
    assert_eq!(begun.len(), 6, "{begun:?}");
}

/// Time advances although nothing happens.
#[test]
fn state_reports_the_current_time() {
    let own = simulated("time");
    let rested = own.await_state(|state| state["why"] == "reached: problem");
    own.await_state(|state| exact(&state["now"]) > exact(&rested["now"]) + 1.0);
}

#[test]
fn guarantee_describes_its_quantities() {
    let own = simulated("meanings");
    own.await_state(|state| state["activity"] == "executing");
    let (_, guarantee) = own.get("/v1/guarantee");
    let parameters = guarantee["parameters"].as_array().expect("parameters");
    assert_eq!(parameters.len(), 6, "{guarantee}");
    for parameter in parameters {
        let meaning = parameter["meaning"].as_str().expect("words");
        assert!(meaning.starts_with("duration of (do "), "{meaning}");
        // These durations have no upper limit.
        assert_eq!(parameter["most"]["exact"], "inf", "{guarantee}");
    }
    let told = ctl(&["--to", &own.address(), "guarantee"]);
    let told = String::from_utf8_lossy(&told.stdout).into_owned();
    assert!(told.contains("duration of (do "), "{told}");
}

/// A reported number is used in the next plan: if the battery needs a larger reserve, it is charged
/// first.
#[test]
fn changed_number_is_used_in_planning() {
    let battery = ["domain", "problem"].map(|it| format!("cases/battery/{it}.pddl"));
    let run = |name: &str, reserve: Option<&str>| {
        let place = folder(name);
        let text = fs::read_to_string(command::root().join(&battery[1])).expect("a problem");
        let goal = "(:goal (and (surveyed crater) (surveyed boulder)))";
        let text = text.replace(goal, "(:goal (and))");
        let problem = place.join("problem.pddl");
        fs::write(&problem, text).expect("written");
        let problem = problem.display().to_string();
        let own = Executive::start(&place, &[&battery[0], &problem, "--realtime", "100"]);
        own.await_state(|state| state["activity"] == "resting");
        if let Some(reserve) = reserve {
            let line = ["number", "(reserve rover)", reserve];
            let told = ctl(&[
                &["--token", &own.token(), "--to", &own.address()],
                &line[..],
            ]
            .concat());
            assert!(told.status.success(), "{told:?}");
            let (_, state) = own.get("/v1/state");
            let numbers = state["numbers"].as_array().expect("numbers");
            let is_it = |it: &&Value| it["fluent"] == "(reserve rover)";
            let own = numbers.iter().find(is_it).expect("the reserve");
            assert_eq!(own["value"]["exact"], reserve, "{state}");
        }
        let goal = json!({"goal": "(surveyed crater)", "name": "crater"});
        assert_eq!(own.post("/v1/goals", &goal).0, 200);
        own.await_state(|state| state["why"] == "reached: crater");
        let begun = lines(&place, "trace.jsonl");
        let starts = begun
            .iter()
            .filter(|line| line.contains("\"event\":\"command\""));
        let charges = starts.filter(|line| line.contains("(recharge rover)"));
        charges.count()
    };
    assert_eq!(run("as-it-was", None), 0);
    // The survey uses 40 of 80.
    assert!(run("told", Some("50")) > 0);
}

/// By default, only this machine can connect.
#[test]
fn executive_accepts_local_connections_only() {
    let own = simulated("local");
    let text = fs::read_to_string(format!("/proc/{}/net/tcp", own.process()));
    let Ok(text) = text else {
        skipped("this system does not list who listens");
        return;
    };
    let port: u16 = own
        .address()
        .rsplit(':')
        .next()
        .and_then(|it| it.parse().ok())
        .expect("a port");
    let listening: Vec<&str> = text
        .lines()
        .filter_map(|line| line.split_whitespace().nth(1))
        .filter(|it| it.ends_with(&format!(":{port:04X}")))
        .collect();
    assert!(!listening.is_empty(), "{text}");
    // 127.0.0.1 in the machine's byte order.
    assert!(
        listening
            .iter()
            .all(|it| it.starts_with("0100007F:") || it.starts_with("7F000001:")),
        "{listening:?}"
    );
}

/// Checks that a value conforms to a schema and has no members that the schema does not define.
fn conforms(value: &Value, schema: &Value, all: &Value) -> Result<(), String> {
    let wrong = |why: &str| Err(format!("{why}: {value} for {schema}"));
    if let Some(name) = schema["$ref"].as_str() {
        let name = name.rsplit('/').next().unwrap_or_default();
        return conforms(value, &all[name], all);
    }
    if let Some(any) = schema["anyOf"].as_array() {
        let fits = any.iter().any(|it| conforms(value, it, all).is_ok());
        return if fits { Ok(()) } else { wrong("none of these") };
    }
    if let Some(listed) = schema["enum"].as_array() {
        let is_listed = listed.contains(value);
        return if is_listed {
            Ok(())
        } else {
            wrong("not listed")
        };
    }
    match (schema["type"].as_str(), value) {
        (Some("null"), Value::Null)
        | (Some("string"), Value::String(_))
        | (Some("boolean"), Value::Bool(_))
        | (Some("number"), Value::Number(_)) => Ok(()),
        (Some("integer"), Value::Number(number)) if number.is_u64() => Ok(()),
        (Some("array"), Value::Array(items)) => items
            .iter()
            .try_for_each(|it| conforms(it, &schema["items"], all)),
        (Some("object"), Value::Object(members)) => {
            let required = schema["required"].as_array().into_iter().flatten();
            for name in required.filter_map(Value::as_str) {
                if !members.contains_key(name) {
                    return wrong(&format!("`{name}` is missing"));
                }
            }
            members
                .iter()
                .try_for_each(|(name, member)| match schema["properties"].get(name) {
                    Some(own) => conforms(member, own, all),
                    None => wrong(&format!("`{name}` is not in it")),
                })
        }
        _ => wrong("of another type"),
    }
}

#[test]
fn answers_conform_to_the_interface_description() {
    let own = simulated("answers");
    let (_, interface) = own.get("/v1/openapi.json");
    let all = &interface["components"]["schemas"];
    let is_right = |answer: &Value, path: &str, verb: &str, status: &str| {
        let content = &interface["paths"][path][verb]["responses"][status]["content"];
        let schema = &content["application/json"]["schema"];
        assert!(schema.is_object(), "{verb} {path}: {interface}");
        conforms(answer, schema, all).unwrap_or_else(|why| panic!("{verb} {path}: {why}"));
    };
    for activity in ["executing", "resting"] {
        own.await_state(|state| state["activity"] == activity);
        for path in ["/v1/state", "/v1/plan", "/v1/guarantee", "/v1/next"] {
            is_right(&own.get(path).1, path, "get", "200");
        }
    }
    let (_, taken) = own.post("/v1/goals", &json!({"goal": "(done a3)", "name": "x"}));
    is_right(&taken, "/v1/goals", "post", "200");
    let (status, refusal) = own.post("/v1/goals", &json!({"goal": "(nonsense)"}));
    assert_eq!(status, 422);
    is_right(&refusal, "/v1/goals", "post", "default");
    // `conforms` detects wrong values.
    let mut state = own.get("/v1/state").1;
    state["plans"] = json!("many");
    assert!(conforms(&state, &all["State"], all).is_err());
    state["plans"] = json!(1);
    assert_eq!(conforms(&state, &all["State"], all), Ok(()));
    state["more"] = json!(1);
    assert!(conforms(&state, &all["State"], all).is_err());
}

/// A suspended process keeps its port open.
#[test]
fn unresponsive_and_absent_executives_are_distinguished() {
    let stopped = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = stopped.local_addr().expect("an address").to_string();
    let asked = ctl(&["--to", &address, "state"]);
    let said = String::from_utf8_lossy(&asked.stderr).into_owned();
    assert_eq!(asked.status.code(), Some(2), "{said}");
    assert!(
        said.contains("accepts connections, but does not answer"),
        "{said}"
    );
    drop(stopped);
    let asked = ctl(&["--to", &address, "state"]);
    let said = String::from_utf8_lossy(&asked.stderr).into_owned();
    assert_eq!(asked.status.code(), Some(2), "{said}");
    assert!(said.contains("cannot reach the executive"), "{said}");
}
