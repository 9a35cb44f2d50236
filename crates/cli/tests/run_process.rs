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

#[test]
fn a_world_that_is_no_world_ends_the_run_with_a_message() {
    for (command, message) in [
        ("no-such-program", "cannot start the world"),
        // Whether it is noticed when telling or when listening is a matter of chance.
        ("true", "the world "),
        ("echo hello", "the world "),
        ("yes hello", "the world said `hello`"),
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
    assert!(text.contains("has not answered in time"), "{text}");
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
