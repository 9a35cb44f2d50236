//! `world-check` names the faults of programs that are worlds, and the Python library makes correct
//! ones.

use std::collections::BTreeMap;
use std::fs;
use std::process::Command;

use crate::command::{elbowroom, root};
use crate::robots::python_is_there;
use serde_json::{Value, json};

const DELIVERY: [&str; 3] = [
    "cases/delivery/domain.pddl",
    "cases/delivery/problem.pddl",
    "cases/delivery/plan.plan",
];

/// Returns the document about this world, and the exit code.
fn checked(command: &str, options: &[&str]) -> (Value, Option<i32>) {
    let line = [&["world-check", command, "--json"][..], options].concat();
    let output = elbowroom(&line);
    let document = serde_json::from_slice(&output.stdout);
    let document = document.unwrap_or_else(|_| panic!("no document: {output:?}"));
    (document, output.status.code())
}

/// Returns the checks with that outcome.
fn with_outcome<'a>(document: &'a Value, outcome: &str) -> Vec<&'a str> {
    let checks = document["checks"].as_array().expect("checks");
    let checks = checks.iter().filter(|check| check["outcome"] == outcome);
    checks.filter_map(|check| check["check"].as_str()).collect()
}

/// Writes a program of `tests/files/worlds.py` with this fault. Returns its command line and its
/// file.
fn world(fault: &str) -> (String, String) {
    let script = fs::read_to_string(root().join("crates/cli/tests/files/worlds.py"));
    let script = script.expect("the worlds");
    let spoken = serde_json::to_string(fault).expect("a text");
    let script = script.replace("sys.argv[1]", &spoken);
    let name = format!(
        "elbowroom-{}-{}.py",
        std::process::id(),
        fault.replace(' ', "-")
    );
    let file = std::env::temp_dir().join(name).display().to_string();
    fs::write(&file, script).expect("a temporary file can be written");
    (format!("python3 {file}"), file)
}

#[test]
fn faults_of_worlds_are_reported() {
    if !python_is_there() {
        return;
    }
    for (fault, check) in [
        ("is silent", "answers"),
        ("answers another question", "answers"),
        ("writes no JSON", "speaks"),
        ("speaks of feedback without greeting", "speaks"),
        ("speaks version 3", "speaks"),
        ("greets twice", "speaks"),
        ("stands still", "keeps-time"),
        ("goes back in time", "keeps-time"),
        ("oversleeps", "keeps-time"),
        ("never starts", "starts"),
        ("finishes what has not started", "starts-before-it-ends"),
        ("starts after it ends", "starts-before-it-ends"),
        ("never ends", "ends"),
        ("repeats itself", "ends-once"),
        ("answers each cancel", "ends-once"),
        ("reports late", "reports-in-time"),
        ("is ahead of time", "reports-in-time"),
        ("knows other tickets", "knows-its-tickets"),
        ("does one thing at a time", "does-two-at-once"),
        ("never answers a cancel", "cancels"),
        ("dies of a cancel that comes too late", "lives"),
        ("dies of what it does not know", "lives"),
        ("dies when it has to work", "lives"),
        ("dies of beliefs", "hears-beliefs"),
        ("answers beliefs", "hears-beliefs"),
        ("forgets", "resumes"),
        ("forgets what is over", "resumes"),
        ("claims it only once", "resumes"),
        ("does not say what became of it", "resumes"),
        ("begins again", "resumes"),
        ("invents a start", "resumes"),
        ("never ends what was under way", "resumes"),
        ("does not start again", "lives"),
        ("loses its time", "keeps-time"),
        ("does not stop", "stops"),
    ] {
        let (command, file) = world(fault);
        let (document, code) = checked(&command, &["--answer-within", "2"]);
        assert_eq!(code, Some(1), "{fault}: {document:#}");
        assert_eq!(document["conforms"], false, "{fault}");
        let wrong = with_outcome(&document, "wrong");
        assert!(wrong.contains(&check), "{fault}: {document:#}");
        let _ = fs::remove_file(format!("{file}.ledger"));
        fs::remove_file(file).expect("the world is there");
    }
}

#[test]
fn conforming_world_passes_all_checks() {
    if !python_is_there() {
        return;
    }
    let (right, file) = world("right");
    let (remembers, script) = with_a_ledger();
    // Worlds without a ledger skip the checks of resuming and of beliefs. The last one speaks
    // version 1 of the protocol.
    for (command, speaks, skips) in [
        (right.as_str(), 2, &[][..]),
        (&remembers, 2, &[]),
        (
            "python3 clients/python/example_simulation.py",
            2,
            &["hears-beliefs", "resumes"],
        ),
        (
            "python3 clients/python/example_world.py",
            2,
            &["hears-beliefs", "resumes"],
        ),
        (
            "python3 examples/world.py",
            1,
            &["hears-beliefs", "resumes"],
        ),
    ] {
        for plan in [&DELIVERY[..], &[]] {
            let (document, code) = checked(command, plan);
            assert_eq!(code, Some(0), "{command}: {document:#}");
            assert_eq!(document["speaks"], speaks, "{command}");
            assert_eq!(with_outcome(&document, "skipped"), skips, "{document:#}");
            let checks = document["checks"].as_array().expect("checks");
            for check in checks.iter().filter(|it| it["outcome"] == "skipped") {
                assert_eq!(
                    check["why"],
                    json!(["the world does not claim this capability"])
                );
            }
        }
    }
    for file in [file, script] {
        let _ = fs::remove_file(format!("{file}.ledger"));
        fs::remove_file(file).expect("the world is there");
    }
}

/// A world of the Python library that keeps a ledger of its starts and receives beliefs.
fn with_a_ledger() -> (String, String) {
    let script = "import os, sys
sys.path.insert(0, os.path.join(os.getcwd(), 'clients', 'python'))
from elbowroom_world import World
world = World('remembers', speed=20, ledger=__file__ + '.ledger')

@world.action('*', resumes=True)
def work(action):
    begun = action.start if action.start is not None else world.now()
    action.sleep(begun + (action.duration or 0) - world.now())

@world.believed
def believed(facts, values):
    pass

world.run()
";
    let name = format!("elbowroom-{}-remembers.py", std::process::id());
    let file = std::env::temp_dir().join(name).display().to_string();
    fs::write(&file, script).expect("a temporary file can be written");
    (format!("python3 {file}"), file)
}

#[test]
fn world_that_cannot_be_started_is_an_error() {
    let output = elbowroom(&["world-check", "no-such-program"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(text.contains("cannot start the world"), "{text}");
}

/// The clock of a robot's arm is ahead and runs twice as fast. Reported events have the time of
/// that clock, converted to the world's time, and not the time of their arrival.
#[test]
fn times_of_another_clock_are_respected() {
    if !python_is_there() {
        return;
    }
    let script = "import os, sys
sys.path.insert(0, os.path.join(os.getcwd(), 'clients', 'python'))
from elbowroom_world import World
world = World('arm', speed=20)

@world.starter('*')
def work(action):
    arm = lambda time: 1e9 + 2 * time
    world.clock('arm', arm(world.now()), rate=2)
    action.started()
    def end():
        action.sleep(action.duration or 0)
        happened = world.now() - 0.5
        with open(sys.argv[1], 'a') as file:
            print(action.ticket, happened, file=file)
        action.succeeded(stamp=('arm', arm(happened)))
    import threading
    threading.Thread(target=end, daemon=True).start()

world.run()
";
    let file = |name: &str| {
        let name = format!("elbowroom-{}-{name}", std::process::id());
        std::env::temp_dir().join(name).display().to_string()
    };
    let [program, times, trace] = ["arm.py", "times", "arm.jsonl"].map(file);
    fs::write(&program, script).expect("a temporary file can be written");
    let world = format!("python3 {program} {times}");
    let line = ["--world-process", &world, "--trace", &trace];
    let output = elbowroom(&[&["run"], &DELIVERY[..], &line].concat());
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    let happened = fs::read_to_string(&times).expect("what has happened");
    let happened: BTreeMap<u64, f64> = happened
        .lines()
        .map(|line| {
            let (ticket, time) = line.split_once(' ').expect("two numbers");
            let time = time.parse().expect("a time");
            (ticket.parse().expect("a ticket"), time)
        })
        .collect();
    let text = fs::read_to_string(&trace).expect("a trace");
    let lines = text
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"));
    let mut heard = 0;
    for line in lines.filter(|line: &Value| line["event"] == "observed") {
        let seen = &line["observation"];
        if seen["type"] == "ended" {
            let ticket = seen["ticket"].as_u64().expect("a ticket");
            let time = seen["time"]["decimal"].as_f64().expect("a time");
            // Reading the clock takes a moment.
            assert!(
                (time - happened[&ticket]).abs() < 0.2,
                "{line}: {happened:?}"
            );
            heard += 1;
        }
    }
    assert_eq!(heard, happened.len(), "{text}");
    for file in [program, times, trace] {
        fs::remove_file(file).expect("it was written");
    }
}

/// The progress of running actions is recorded in the trace and changes no decision.
#[test]
fn feedback_is_recorded_and_replayed() {
    if !python_is_there() {
        return;
    }
    let trace = std::env::temp_dir().join(format!("elbowroom-{}-fb.jsonl", std::process::id()));
    let trace = trace.display().to_string();
    let world = "python3 clients/python/example_world.py";
    let run = [
        &["run"][..],
        &DELIVERY[..],
        &["--world-process", world, "--trace", &trace],
    ]
    .concat();
    let output = elbowroom(&run);
    assert!(output.status.success(), "{output:?}");
    let lines = fs::read_to_string(&trace).expect("a trace");
    assert!(lines.contains(r#""type":"feedback","ticket":0"#), "{lines}");
    assert!(!lines.contains("unintelligible"), "{lines}");
    let replayed = elbowroom(&["run", "--replay", &trace]);
    assert!(replayed.status.success(), "{replayed:?}");
    fs::remove_file(trace).expect("the trace is there");
}

#[test]
fn the_library_for_python_and_the_bridges_pass_their_own_tests() {
    if !python_is_there() {
        return;
    }
    for folder in ["clients/python", "examples"] {
        let tests = ["-m", "unittest", "discover", "-s", folder, "-v"];
        let output = Command::new("python3")
            .args(tests)
            .current_dir(root())
            .output();
        let output = output.expect("python3 can be started");
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{folder}: {said}");
        assert!(said.contains("\nOK"), "{folder}: {said}");
    }
}

/// The initial state is sent completely, and then each change once. At the end the program has the
/// same state as the validator.
#[test]
fn belief_subscriber_receives_all_beliefs_once() {
    if !python_is_there() {
        return;
    }
    let battery =
        ["domain.pddl", "problem.pddl", "plan.plan"].map(|it| format!("cases/battery/{it}"));
    let name = format!("elbowroom-{}-believed", std::process::id());
    let file = std::env::temp_dir().join(name);
    let _ = fs::remove_file(&file);
    let world = format!(
        "python3 crates/cli/tests/files/listening.py {}",
        file.display()
    );
    let files = battery.each_ref().map(String::as_str);
    let run = elbowroom(&[&["run"], &files[..], &["--world-process", &world]].concat());
    assert_eq!(run.status.code(), Some(0), "{run:?}");
    let told = fs::read_to_string(&file).expect("it was told something");
    let told: Vec<Value> = told
        .lines()
        .map(|line| serde_json::from_str(line).expect("JSON"))
        .collect();
    let (mut facts, mut values) = (serde_json::Map::new(), serde_json::Map::new());
    for (number, message) in told.iter().enumerate() {
        let entries = |name: &str| message[name].as_object().expect("entries").clone();
        for (all, changed) in [
            (&mut facts, entries("facts")),
            (&mut values, entries("values")),
        ] {
            for (name, now) in changed {
                let nothing = Value::from(false);
                let before = all.insert(name.clone(), now.clone());
                let is_new = before.as_ref().unwrap_or(&nothing) != &now;
                assert!(is_new, "message {number} says {name} again");
            }
        }
        if number == 0 {
            let problem = fs::read_to_string(root().join(&battery[1])).expect("the problem");
            assert!(
                facts
                    .iter()
                    .all(|(name, now)| now == true && problem.contains(name))
            );
            assert!(!facts.is_empty() && !values.is_empty());
        }
    }
    assert!(told.len() > 2, "{told:?}");
    let judged = elbowroom(&[&["check"], &files[..], &["--json"]].concat());
    let judged: Value = serde_json::from_slice(&judged.stdout).expect("a document");
    for it in judged["values"].as_array().expect("values") {
        let name = it["fluent"].as_str().expect("a name");
        let (told, judged) = (values[name].as_f64(), it["value"]["decimal"].as_f64());
        let off = told.zip(judged).map(|(told, judged)| (told - judged).abs());
        // The simulation's clock uses floats.
        assert!(
            off.is_some_and(|it| it < 1e-9),
            "{name}: {told:?}, {judged:?}"
        );
    }
    for it in judged["goals"].as_array().expect("goals") {
        let goal = it["goal"].as_str().expect("a condition");
        assert!(
            goal.contains('>') || facts[goal] == true,
            "{goal} in {facts:?}"
        );
    }
    fs::remove_file(&file).expect("it is there");
}
