//! Worlds that are processes, and runs that are killed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn elbowroom(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .env("NO_COLOR", "1")
        .args(arguments)
        .output()
        .expect("the command can be started")
}

const DELIVERY: [&str; 2] = ["cases/delivery/domain.pddl", "cases/delivery/problem.pddl"];

/// A file that no other test uses.
fn temporary(name: &str) -> String {
    let name = format!("elbowroom-{}-{name}", std::process::id());
    std::env::temp_dir().join(name).display().to_string()
}

#[test]
fn the_example_world_delivers_the_parcel() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: there is no python3");
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

/// What a command leads to is told in the next answer, at once. The example once let all the
/// patience with a cancelled action pass instead: 600 seconds.
#[test]
fn the_example_world_reports_a_cancel_at_once() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("skipped: there is no python3");
        return;
    }
    let mut run = vec!["run", DELIVERY[0], DELIVERY[1], "--json"];
    run.extend(["--executor", "fixed:0", "--max-replans", "3"]);
    run.extend(["--world-process", "python3 examples/world.py"]);
    let output = elbowroom(&run);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).expect("a document");
    let cancelled = |step: &&serde_json::Value| step["outcome"] == "cancelled";
    let executed = report["executed"].as_array().expect("steps");
    assert!(executed.iter().find(cancelled).is_some(), "{report:#}");
    let time = report["time"]["decimal"].as_f64().expect("a time");
    assert!(time < 60.0, "{report:#}");
}

/// A run in a world that is this shell script, which has `seconds` for each answer.
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

/// Answers every question with the lines of `$1`.
fn answering(lines: &str) -> String {
    format!(
        "while read -r line; do case \"$line\" in *\\\"wait\\\"*|*\\\"look\\\"*) echo '{lines}';; esac; \
         done\n"
    )
}

#[test]
fn every_way_to_be_no_world_ends_the_run_and_is_named() {
    let fact = r#"{"type":"fact","fact":"(at rover depot)","becomes":true,"time":0}"#;
    let zero = r#"{"type":"time","now":0}"#;
    let cases = [
        ("still", answering(zero), "30", "its clock stands still"),
        (
            "chatty",
            answering(&format!("{fact}\n{zero}")),
            "30",
            "its clock stands still",
        ),
        // Valid lines, and no end of them.
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
        // Says something all the time, but never what time it is.
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
        ("rude", answering("hello"), "30", "it said `hello`"),
    ];
    for (name, script, seconds, message) in cases {
        let output = in_shell(name, &script, seconds);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{name}: {output:?}");
        assert!(text.contains(message), "{name}: {text}");
        assert!(text.contains("help: "), "{name}: {text}");
    }
}

#[test]
fn a_world_that_cannot_be_started_ends_the_run_with_a_message() {
    for (command, message) in [
        ("no-such-program", "cannot start the world"),
        // Whether it is noticed when telling or when listening is a matter of chance.
        ("true", "has ended (exit status: 0)"),
        ("echo hello", ""),
        ("yes hello", "it said `hello`"),
    ] {
        let run = ["run", DELIVERY[0], DELIVERY[1], "--world-process", command];
        let output = elbowroom(&run);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{command}: {output:?}");
        assert!(text.contains(message), "{command}: {text}");
    }
}

#[test]
fn a_world_that_does_not_answer_is_not_waited_for_for_ever() {
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

/// `kill -9` in the middle of a run leaves a trace that can be played back as far as it goes.
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
    // At a real second for each second of the plan, it has begun and is far from done.
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
    assert!(text.contains("cut short"), "{text}");
    fs::remove_file(trace).expect("the trace is there");
}
