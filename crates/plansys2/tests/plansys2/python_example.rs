//! Plays the same scripts to the hub and to that of `examples/plansys2_world.py`. Both must react
//! in the same way.

use std::io::Write as _;
use std::process::{Command, Stdio};
use std::time::Duration;

use elbowroom_plansys2::message::{ActionExecution, ActionPerformerStatus};
use elbowroom_plansys2::{Action, ActionUpdate, Effect, Hub};
use rand::{Rng as _, SeedableRng as _, seq::IndexedRandom as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};

const SCRIPTS: u64 = 400;
const STEPS: u64 = 150;
const ROBOTS: [&str; 3] = ["robot1", "robot2", "Robot3"];
const ACTIONS: [(&str, &[&str]); 4] = [
    ("move", &["r1", "a", "b"]),
    ("move", &["r2", "a", "b"]),
    ("pick", &["r1", "box"]),
    ("beep", &[]),
];

/// Generates events, with enough order for successful conversations and enough disorder for
/// failures.
fn script(seed: u64) -> Vec<Value> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut quarters = 0_u32;
    let mut tickets = 0_u64;
    let steps = (0..STEPS).map(|_| {
        quarters += *[0, 0, 1, 1, 2, 4, 25].choose(&mut rng).expect("some");
        let at = f64::from(quarters) / 4.0;
        let (action, arguments) = *ACTIONS.choose(&mut rng).expect("some");
        let node = *ROBOTS.choose(&mut rng).expect("some");
        match rng.random_range(0..20) {
            0..4 => {
                tickets += 1;
                json!({"at": at, "what": "begin", "ticket": tickets, "action": action, "arguments": arguments,
                       "instantaneous": action == "beep"})
            }
            4 if tickets > 0 => {
                json!({"at": at, "what": "cancel", "ticket": rng.random_range(1..=tickets)})
            }
            5..13 => {
                // Mostly responses, because no action would begin without one.
                let kind = *[2, 2, 2, 5, 5, 6, 6, 1, 3, 4, 7].choose(&mut rng).expect("some");
                let is_loud = rng.random_bool(0.1);
                let action = if is_loud { action.to_uppercase() } else { action.to_owned() };
                let alone = arguments.is_empty() && rng.random_bool(0.5);
                let arguments = if alone { vec![action.as_str()] } else { arguments.to_vec() };
                let node = if kind == 1 { "elbowroom" } else { node };
                let status = ["", "at it", "the wheels slip"].choose(&mut rng).expect("some");
                let message = json!({"type": kind, "node_id": node, "action": action, "arguments": arguments,
                    "success": rng.random_bool(0.6), "completion": f64::from(rng.random_range(0..5_u8)) / 4.0,
                    "status": status});
                json!({"at": at, "what": "message", "message": message})
            }
            13..17 => {
                let state = [0, 1, 1, 1, 2, 2, 2, 2, 4].choose(&mut rng).expect("some");
                let status = json!({"status_stamp": {"sec": 0, "nanosec": 0}, "state": state, "action": action,
                    "specialized_arguments": [], "node_name": node});
                json!({"at": at, "what": "status", "status": status})
            }
            _ => json!({"at": at, "what": "tick"}),
        }
    });
    steps.collect()
}

/// Returns the outputs of the hub at each step of a script.
fn play(script: &[Value]) -> Vec<Vec<Value>> {
    let mut hub = Hub::new("elbowroom");
    let mut names = vec![String::new()];
    let step = |it: &Value| {
        let now = Duration::from_secs_f64(it["at"].as_f64().expect("a time"));
        match it["what"].as_str().expect("a text") {
            "begin" => {
                let arguments: Vec<String> =
                    serde_json::from_value(it["arguments"].clone()).expect("texts");
                let name = it["action"].as_str().expect("a text").to_owned();
                names.push(joined(&name, &arguments));
                let is_instantaneous = it["instantaneous"] == true;
                let ticket = it["ticket"].as_u64().expect("a number");
                hub.begin(
                    Action {
                        ticket,
                        name,
                        arguments,
                        is_instantaneous,
                    },
                    now,
                );
            }
            "cancel" => hub.cancel(it["ticket"].as_u64().expect("a number")),
            "tick" => hub.tick(now),
            "message" => {
                let message: ActionExecution =
                    serde_json::from_value(it["message"].clone()).expect("a message");
                hub.message(&message, now);
            }
            _ => {
                let status: ActionPerformerStatus =
                    serde_json::from_value(it["status"].clone()).expect("a status");
                hub.status(&status, now);
            }
        }
        hub.effects()
            .into_iter()
            .map(|effect| written(effect, &names))
            .collect()
    };
    script.iter().map(step).collect()
}

fn joined(name: &str, arguments: &[String]) -> String {
    let words = [name]
        .into_iter()
        .chain(arguments.iter().map(String::as_str));
    words.collect::<Vec<_>>().join(" ")
}

/// Converts an output to the format of `hub_twin.py`.
fn written(effect: Effect, names: &[String]) -> Value {
    match effect {
        Effect::Send(it) => json!([
            joined(&it.action, &it.arguments),
            "send",
            it.kind,
            it.node_id
        ]),
        Effect::Remark(text) => panic!("nobody else speaks in these scripts: {text}"),
        Effect::Report(ticket, told) => {
            let name = &names[usize::try_from(ticket).expect("small")];
            match told {
                ActionUpdate::Started => json!([name, "tell", ticket, "started"]),
                ActionUpdate::Succeeded => json!([name, "tell", ticket, "succeeded"]),
                ActionUpdate::Cancelled => json!([name, "tell", ticket, "cancelled"]),
                ActionUpdate::Failed(why) => json!([name, "tell", ticket, "failed", why]),
                ActionUpdate::Feedback { completion, note } => {
                    json!([name, "tell", ticket, "feedback", completion, note])
                }
            }
        }
    }
}

/// Sorts outputs by action, because the order of simultaneous outputs is irrelevant.
fn in_order(mut effects: Vec<Value>) -> Vec<Value> {
    effects.sort_by_key(|it| it[0].to_string());
    effects
}

/// Plays scripts to the Python hub. Returns `None` if Python is not installed.
fn played_by_python(scripts: &[Vec<Value>]) -> Option<Vec<Vec<Vec<Value>>>> {
    let program = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/hub_twin.py");
    let mut child = Command::new("python3")
        .arg("-B")
        .arg(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .ok()?;
    let mut input = child.stdin.take().expect("it is piped");
    let lines: Vec<_> = scripts
        .iter()
        .map(|it| json!(it).to_string() + "\n")
        .collect();
    let writer = std::thread::spawn(move || input.write_all(lines.concat().as_bytes()));
    let output = child.wait_with_output().expect("it ends");
    writer.join().expect("no panic").expect("it reads all");
    assert!(output.status.success(), "hub_twin.py failed");
    let text = String::from_utf8(output.stdout).expect("UTF-8");
    Some(
        text.lines()
            .map(|it| serde_json::from_str(it).expect("JSON"))
            .collect(),
    )
}

#[test]
fn hub_agrees_with_python_example() {
    let scripts: Vec<_> = (0..SCRIPTS).map(script).collect();
    let Some(theirs) = played_by_python(&scripts) else {
        return crate::skipped::skipped("there is no python3");
    };
    assert_eq!(theirs.len(), scripts.len());
    let mut outcomes = [
        ("started", 0),
        ("succeeded", 0),
        ("cancelled", 0),
        ("failed", 0),
        ("feedback", 0),
    ];
    for (seed, (script, theirs)) in scripts.iter().zip(theirs).enumerate() {
        for (step, (ours, theirs)) in play(script).into_iter().zip(theirs).enumerate() {
            let (ours, theirs) = (in_order(ours), in_order(theirs));
            assert_eq!(ours, theirs, "script {seed}, step {step}: {}", script[step]);
            for (what, count) in &mut outcomes {
                *count += ours
                    .iter()
                    .filter(|it| it[1] == "tell" && it[3] == *what)
                    .count();
            }
        }
    }
    // The random scripts must contain enough events.
    assert!(
        outcomes.iter().all(|(_, count)| *count > 50),
        "{outcomes:?}"
    );
}
