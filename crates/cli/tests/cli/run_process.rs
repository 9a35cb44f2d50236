//! Worlds that are processes, and killed runs.

use std::fs;
use std::process::{Command, Output};

use crate::command::{elbowroom, root};
use crate::skipped::skipped;

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

/// A file that no other test uses.
fn temporary(name: &str) -> String {
    let name = format!("elbowroom-{}-process-{name}", std::process::id());
    std::env::temp_dir().join(name).display().to_string()
}

#[test]
fn the_example_world_delivers_the_parcel() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let trace = temporary("world.jsonl");
    let output = elbowroom(&[
        "run",
        DELIVERY[0],
        DELIVERY[1],
        "--world-process",
        "python3 examples/world.py",
        "--trace",
        &trace,
    ]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{output:?}");
    assert!(text.contains("goal reached at 33.003"), "{text}");
    let replayed = elbowroom(&["run", "--replay", &trace]);
    assert!(replayed.status.success(), "{replayed:?}");
    fs::remove_file(trace).expect("the trace is there");
}

/// The result of a command is reported in the next answer, immediately. An earlier version of the example
/// waited 600 seconds for the cancelled action instead.
#[test]
fn the_example_world_reports_a_cancel_at_once() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let mut run = vec!["run", DELIVERY[0], DELIVERY[1], "--json"];
    run.extend(["--executor", "fixed:0", "--max-replans", "0"]);
    run.extend(["--world-process", "python3 examples/world.py"]);
    let output = elbowroom(&run);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a document");
    let cancelled = |step: &&serde_json::Value| step["outcome"] == "cancelled";
    let executed = report["executed"].as_array().expect("steps");
    assert!(executed.iter().find(cancelled).is_some(), "{report:#}");
    let time = report["time"]["decimal"].as_f64().expect("a time");
    assert!(time < 60.0, "{report:#}");
}

/// Runs in a world whose program dies in its first `lives` lives, and may be restarted three times.
fn in_dying_world(name: &str, lives: &str, more: &[&str]) -> Output {
    let counter = temporary(name);
    let script = "crates/cli/tests/files/dying_world.py";
    let command = format!("python3 {script} {counter} 2 {lives}");
    let mut run = vec!["run", DELIVERY[0], DELIVERY[1], "--world-process", &command];
    run.extend(["--restart-world", "3"]);
    let output = elbowroom(&[&run[..], more].concat());
    fs::remove_file(counter).expect("the world has counted its lives");
    output
}

#[test]
fn a_world_that_has_ended_is_started_again() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let (trace, journal) = (temporary("again.jsonl"), temporary("again.journal"));
    for (kind, file) in [("--trace", &trace), ("--journal", &journal)] {
        let output = in_dying_world("again", "1", &[kind, file]);
        assert!(output.status.success(), "{output:?}");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(
            text.contains("failed: it was running when the world ended"),
            "{text}"
        );
        let warnings = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(warnings.contains("restart 1 of 3"), "{warnings}");
        let replayed = elbowroom(&["run", "--replay", file]);
        assert!(replayed.status.success(), "{replayed:?}");
        fs::remove_file(file).expect("the record is there");
    }
}

#[test]
fn a_world_that_ends_again_and_again_ends_the_run() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let output = in_dying_world("often", "9", &[]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let warnings = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(warnings.contains("restart 3 of 3"), "{warnings}");
}

/// Runs in a world that is a shell script with `seconds` for each answer.
fn in_shell(name: &str, script: &str, seconds: &str) -> Output {
    let file = temporary(name);
    fs::write(&file, script).expect("a temporary file can be written");
    let command = format!("sh {file}");
    let [domain, problem] = DELIVERY;
    let mut run = vec!["run", domain, problem, "--world-process", &command];
    run.extend(["--answer-within", seconds]);
    let output = elbowroom(&run);
    fs::remove_file(file).expect("the script is there");
    output
}

/// Returns a script that answers every question with these lines.
fn answering(lines: &str) -> String {
    format!(
        "while read -r line; do case \"$line\" in *\\\"wait\\\"*|*\\\"look\\\"*) echo '{lines}';; esac; \
         done\n"
    )
}

#[test]
fn invalid_world_programs_end_the_run_and_are_reported() {
    let fact = r#"{"type":"fact","fact":"(at rover depot)","becomes":true,"time":0}"#;
    let zero = r#"{"type":"time","now":0}"#;
    let cases = [
        ("still", answering(zero), "30", "its clock does not advance"),
        (
            "chatty",
            answering(&format!("{fact}\n{zero}")),
            "30",
            "its clock does not advance",
        ),
        // Valid lines without end.
        (
            "babbler",
            format!("exec yes '{fact}'\n"),
            "30",
            "more than 16 MB",
        ),
        (
            "endless",
            "head -c 3000000 /dev/zero | tr '\\0' x; exec sleep 60\n".to_owned(),
            "30",
            "without a line feed",
        ),
        // Lines all the time, but never a `time`.
        (
            "slow",
            format!("while echo '{fact}'; do sleep 0.2; done\n"),
            "1",
            "has not ended its answer",
        ),
        (
            "deaf",
            format!("while echo '{zero}'; do sleep 0.001; done\n"),
            "1",
            "has not read",
        ),
        (
            "silent",
            "exec sleep 60\n".to_owned(),
            "1",
            "has not ended its answer",
        ),
        (
            "dead",
            "read line; exit 3\n".to_owned(),
            "30",
            "exit status: 3",
        ),
        (
            "killed",
            "read line; kill -9 $$\n".to_owned(),
            "30",
            "signal: 9",
        ),
        ("rude", answering("hello"), "1", "invalid message `hello`"),
    ];
    for (name, script, seconds, message) in cases {
        let output = in_shell(name, &script, seconds);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{name}: {output:?}");
        assert!(text.contains(message), "{name}: {text}");
        assert!(text.contains("help: "), "{name}: {text}");
    }
}

/// Runs with a world like `examples/world.py` that sends the line `first` at the start of its first
/// answer.
fn example_world_with_first_line(
    name: &str,
    first: &str,
    options: &[&str],
) -> Option<(Output, String)> {
    if Command::new("python3").arg("--version").output().is_err() {
        return None;
    }
    let example = fs::read_to_string(root().join("examples/world.py")).expect("the example");
    let begins = "now, ends, news = 0.0, {}, []";
    assert!(example.contains(begins), "{example}");
    // A JSON string is also a valid string in Python.
    let first = serde_json::to_string(first).expect("a text");
    let said = format!("print({first}, flush=True)\n");
    let says = example.find("for message in").expect("the loop");
    let example = format!("{}{said}{}", &example[..says], &example[says..]);
    let (file, trace) = (temporary(name), temporary(&format!("{name}.jsonl")));
    fs::write(&file, example).expect("written");
    let command = format!("python3 {file}");
    let run = ["run", DELIVERY[0], DELIVERY[1], "--world-process", &command];
    let output = elbowroom(&[&run[..], &["--trace", &trace], options].concat());
    fs::remove_file(file).expect("the script is there");
    Some((output, trace))
}

/// Facts that no action mentions may be reported, such as `(lies parcel depot)`: a robot cannot
/// know which facts actions mention.
#[test]
fn every_fact_of_the_problem_may_be_reported() {
    for (name, fact, truth) in [
        ("never-true", "(lies parcel depot)", "false"),
        ("now-true", "(LIES parcel depot)", "true"),
    ] {
        let first = format!(r#"{{"type":"fact","fact":"{fact}","becomes":{truth},"time":0}}"#);
        let Some((output, trace)) =
            example_world_with_first_line(name, &first, &["--strict-world"])
        else {
            skipped("there is no python3");
            return;
        };
        assert!(output.status.success(), "{fact}: {output:?}");
        let entries = fs::read_to_string(&trace).expect("a trace");
        assert!(
            entries.contains(r#""fact":"(lies parcel depot)""#),
            "{entries}"
        );
        let replayed = elbowroom(&["run", "--replay", &trace]);
        assert!(replayed.status.success(), "{replayed:?}");
        fs::remove_file(trace).expect("the trace is there");
    }
}

/// By default, an invalid message of the robot does not end the run.
#[test]
fn unparsable_message_is_a_remark_in_the_trace() {
    let fact = |fact: &str| format!(r#"{{"type":"fact","fact":"{fact}","becomes":true,"time":0}}"#);
    for first in [
        fact("(lies parcel moon)"),
        fact("(lies depot parcel)"),
        fact("(lies parcel)"),
        fact("(flies rover)"),
        "hello".to_owned(),
        "{\"type\":\"started\"".to_owned(),
        r#"{"type":"value","fluent":"(height rover)","value":3,"time":0}"#.to_owned(),
        r#"{"type":"dance","time":0}"#.to_owned(),
    ] {
        let Some((output, trace)) = example_world_with_first_line("slip", &first, &[]) else {
            skipped("there is no python3");
            return;
        };
        assert!(output.status.success(), "{first}: {output:?}");
        let entries = fs::read_to_string(&trace).expect("a trace");
        assert!(entries.contains("\"unintelligible\""), "{first}: {entries}");
        assert!(
            entries.contains("cannot be parsed; it is ignored"),
            "{first}"
        );
        let replayed = elbowroom(&["run", "--replay", &trace]);
        assert!(replayed.status.success(), "{replayed:?}");
        fs::remove_file(trace).expect("the trace is there");

        let strict = example_world_with_first_line("strict-slip", &first, &["--strict-world"]);
        let (output, trace) = strict.expect("python3 is there");
        assert_eq!(output.status.code(), Some(2), "{first}: {output:?}");
        fs::remove_file(trace).expect("the trace is there");
    }
}

/// Control characters in messages of other programs are escaped, and lines are wrapped at 80
/// columns.
#[test]
fn output_of_world_is_escaped_and_wrapped() {
    let why = format!(r"line\n\u001b[2J {}", "word ".repeat(60));
    let first =
        format!(r#"{{"type":"ended","ticket":0,"outcome":"failed","why":"{why}","time":0}}"#);
    let Some((output, trace)) = example_world_with_first_line("rude", &first, &[]) else {
        skipped("there is no python3");
        return;
    };
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(text.contains(r"line\n\u{1b}[2J"), "{text}");
    let longest = text.lines().map(|line| line.chars().count()).max();
    assert!(longest <= Some(80), "{text}");
    fs::remove_file(trace).expect("the trace is there");
}

/// The document of a run contains the executed actions, even if the world failed.
#[test]
fn a_run_whose_world_fails_leaves_its_document() {
    let file = temporary("dies");
    // The world answers the first question, so it has certainly started.
    let script = "while read -r line; do case \"$line\" in *wait*) exit 3;; esac; done\n";
    fs::write(&file, script).expect("written");
    let command = format!("sh {file}");
    let [domain, problem] = DELIVERY;
    let mut run = vec!["run", domain, problem, "--json"];
    run.extend(["--world-process", &command]);
    let output = elbowroom(&run);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a document");
    assert_eq!(report["verdict"], "world-failed");
    fs::remove_file(file).expect("the script is there");
}

/// On a wall clock, planning takes its measured time multiplied by the factor, or the given number
/// of seconds. The clock starts when there is a first plan.
#[test]
fn planning_takes_time_on_a_wall_clock() {
    let (script, world) = (temporary("planner"), temporary("slow.toml"));
    let own = env!("CARGO_BIN_EXE_elbowroom");
    let program = format!("sleep 0.2; exec {own} plan \"$1\" \"$2\"\n");
    fs::write(&script, program).expect("written");
    let slow = "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"drive\"\n\
                uniform = { from = 25, to = 26 }\n";
    fs::write(&world, slow).expect("written");
    let command = format!("sh {script} {{domain}} {{problem}}");
    let took = |options: &[&str]| -> Vec<f64> {
        let trace = temporary("wall-clock.jsonl");
        let run = ["run", DELIVERY[0], DELIVERY[1], "--planner", &command];
        let files = ["--trace", &trace, "--world", &world];
        let output = elbowroom(&[&run[..], &files, &["--executor", "guarded"], options].concat());
        let text = fs::read_to_string(&trace).expect("a trace");
        let entries = text
            .lines()
            .map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON"));
        let planned = entries.filter(|entry| entry["event"] == "planned");
        let took: Vec<f64> = planned
            .filter_map(|entry| entry["took"]["decimal"].as_f64())
            .collect();
        assert!(took.len() >= 2, "{took:?}: {output:?}");
        fs::remove_file(trace).expect("the trace is there");
        took
    };
    // There is not enough time for that much planning. The test does not depend on the delivery of
    // the parcel.
    let measured = took(&["--realtime", "1000"]);
    assert!(measured[0].abs() < 1e-9, "{measured:?}");
    assert!(measured[1..].iter().all(|it| *it >= 200.0), "{measured:?}");
    let stated = took(&["--realtime", "1000", "--planning-time", "3"]);
    assert!(
        stated.iter().all(|it| (it - 3.0).abs() < 1e-9),
        "{stated:?}"
    );
    let otherwise = took(&[]);
    assert!(otherwise.iter().all(|it| it.abs() < 1e-9), "{otherwise:?}");
    for file in [script, world] {
        fs::remove_file(file).expect("it is there");
    }
}

#[test]
fn a_world_that_cannot_be_started_ends_the_run_with_a_message() {
    for (command, message) in [
        ("no-such-program", "cannot start the world"),
        ("./crates", "`./crates` is a folder, not a program"),
        ("./README.md", "`./README.md` is not executable"),
        // The exit may be detected during a write or during a read.
        ("true", "has ended (exit status: 0)"),
        ("echo hello", ""),
        ("yes hello", "invalid message `hello`"),
    ] {
        let run = ["run", DELIVERY[0], DELIVERY[1], "--world-process", command];
        let output = elbowroom(&run);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{command}: {output:?}");
        assert!(text.contains(message), "{command}: {text}");
    }
}

#[test]
fn unresponsive_world_times_out() {
    let run = [
        "run",
        DELIVERY[0],
        DELIVERY[1],
        "--world-process",
        "sleep 60",
        "--answer-within",
        "0.3",
    ];
    let output = elbowroom(&run);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        text.contains("has not ended its answer with `time` within 0.3 s"),
        "{text}"
    );
}

/// `kill -9` during a run leaves a trace that can be replayed up to its end.
#[test]
fn a_run_that_is_killed_leaves_its_trace() {
    let trace = temporary("killed.jsonl");
    let mut run = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .args([
            "run",
            DELIVERY[0],
            DELIVERY[1],
            "--realtime",
            "1",
            "--trace",
            &trace,
        ])
        .spawn()
        .expect("the command can be started");
    // In real time, the run has begun by then and is far from its end.
    let mut lines = 0;
    for _ in 0..200 {
        lines = fs::read_to_string(&trace).map_or(0, |text| text.lines().count());
        if lines >= 10 {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    run.kill().expect("it runs");
    run.wait().expect("it was killed");
    assert!(lines >= 10, "{lines} lines");
    let replayed = elbowroom(&["run", "--replay", &trace]);
    let text = String::from_utf8_lossy(&replayed.stdout).into_owned();
    assert!(replayed.status.success(), "{replayed:?}");
    assert!(text.contains("the trace is incomplete"), "{text}");
    fs::remove_file(trace).expect("the trace is there");
}

/// Runs with a walking time of `seconds`. The plan assumes at most 15 s.
fn run_with_walking_time(seconds: &str) -> (String, Option<i32>) {
    let world = format!("python3 crates/cli/tests/files/late/world.py {seconds}");
    let files = ["domain.pddl", "problem.pddl", "plan.plan"];
    let files = files.map(|file| format!("crates/cli/tests/files/late/{file}"));
    let mut run = vec!["run"];
    run.extend(files.iter().map(String::as_str));
    run.extend(["--world-process", &world]);
    let output = elbowroom(&run);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    (text, output.status.code())
}

/// With the estimate of a walk that takes 25 % longer, there was no plan at 15 s.
#[test]
fn late_action_is_awaited_while_plan_is_feasible() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let (text, code) = run_with_walking_time("15.5");
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("(walk) [15.5]"), "{text}");
    assert!(text.contains("(climb) [10]"), "{text}");
    assert!(!text.contains("slide"), "{text}");
}

/// After more than 16 s there is no plan, but climbing may still take less time than planned. After
/// 21 s it would have to take less than half, and walking is cancelled.
#[test]
fn overdue_action_is_cancelled_if_remaining_plan_is_too_short() {
    if Command::new("python3").arg("--version").output().is_err() {
        skipped("there is no python3");
        return;
    }
    let (text, code) = run_with_walking_time("1000");
    assert_eq!(code, Some(0), "{text}");
    let walked = text
        .lines()
        .find_map(|line| line.split_once("(walk) [")?.1.split_once(']'));
    let (seconds, outcome) = walked.expect("walking is what was done first");
    let seconds: f64 = seconds.parse().expect("a number");
    assert!((20.9..22.0).contains(&seconds), "{text}");
    assert_eq!(outcome, " cancelled", "{text}");
    assert!(text.contains("(slide) [3]"), "{text}");
}
