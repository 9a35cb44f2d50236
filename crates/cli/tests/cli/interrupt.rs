//! Ctrl-C, and the progress line of a search.
#![cfg(target_os = "linux")]
#![allow(clippy::print_stdout, reason = "a test that is skipped should say so")]

#[path = "../../../elbowroom/tests/elbowroom/shared/chains.rs"]
#[allow(dead_code, reason = "other tests have batteries in them")]
mod chains;
#[path = "../../../elbowroom/tests/elbowroom/shared/rounds.rs"]
mod rounds;

use crate::skipped::skipped;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

/// Files of a long search: many interval ends, each bisected more than a thousand times.
struct Long {
    folder: PathBuf,
}

impl Long {
    /// Writes the files of the search to a folder of that name.
    fn new(name: &str) -> Self {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        std::fs::create_dir_all(&folder).expect("a folder");
        let (problem, plan) = rounds::rounds(16);
        let files = [
            ("domain.pddl", rounds::DOMAIN),
            ("problem.pddl", &problem),
            ("rounds.plan", &plan),
        ];
        for (name, text) in files {
            std::fs::write(folder.join(name), text).expect("a file");
        }
        Self { folder }
    }

    fn arguments(&self) -> Vec<String> {
        let file = |name: &str| self.folder.join(name).display().to_string();
        vec![
            "envelope".to_owned(),
            file("domain.pddl"),
            file("problem.pddl"),
            file("rounds.plan"),
            "--precision".to_owned(),
            "1e-390".to_owned(),
        ]
    }
}

/// Waits until a process catches the signal with this number.
fn wait_for_signal_handler(child: &Child, signal: u32) {
    let status = format!("/proc/{}/status", child.id());
    loop {
        let text = std::fs::read_to_string(&status).expect("the process is alive");
        let has_ended = text.lines().any(|line| line.starts_with("State:\tZ"));
        assert!(!has_ended, "the process has ended before it was told to");
        let caught = text.lines().find_map(|line| line.strip_prefix("SigCgt:"));
        let caught = caught.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        if caught.is_some_and(|mask| mask >> (signal - 1) & 1 == 1) {
            return;
        }
        sleep(Duration::from_millis(5));
    }
}

fn send(child: &Child, signal: u32) {
    let killed = Command::new("kill")
        .args([format!("-{signal}"), child.id().to_string()])
        .status()
        .expect("every Unix has `kill`");
    assert!(killed.success());
}

#[test]
fn ctrl_c_ends_the_search_with_the_best_box_so_far() {
    ends_the_search_with_the_best_box_so_far("interrupt", 2);
}

/// Service managers and batch systems send SIGTERM.
#[test]
fn sigterm_ends_the_search_with_the_best_box_so_far() {
    ends_the_search_with_the_best_box_so_far("terminate", 15);
}

fn ends_the_search_with_the_best_box_so_far(name: &str, signal: u32) {
    let child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .args(Long::new(name).arguments())
        .arg("--json")
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command");
    wait_for_signal_handler(&child, signal);
    // Time for a box. Both possible answers are accepted, however much time this is.
    sleep(Duration::from_secs(1));
    send(&child, signal);
    let output = child.wait_with_output().expect("its output");
    let document: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(document["stop"], "cancelled", "{document}");
    let found = &document["parameters"][0]["upper"];
    match output.status.code() {
        Some(0) => assert!(!found.is_null(), "{document}"),
        Some(3) => println!("interrupted before there was a box"),
        other => panic!("exit code {other:?}: {document}"),
    }
    let progress = String::from_utf8_lossy(&output.stderr);
    let is_progress = |line: &str| line.ends_with(" widenings");
    assert!(progress.lines().all(is_progress), "{progress}");
}

/// Twenty robots that work concurrently: too many states for a table of moves.
#[test]
fn ctrl_c_ends_computation_of_policy_table() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("table");
    std::fs::create_dir_all(&folder).expect("a folder");
    let robots = |text: &str| -> String {
        (0..20)
            .map(|robot| text.replace('#', &robot.to_string()))
            .collect()
    };
    let problem = format!(
        "(define (problem twenty) (:domain robots) (:objects{}) (:init (open){} (at 5.4 (not (open)))) (:goal (and{})))",
        robots(" r#"),
        robots(" (idle r#)"),
        robots(" (done r#)")
    );
    let files = [
        ("domain.pddl", ROBOTS),
        ("problem.pddl", &problem),
        ("robots.plan", &robots("0: (work r#) [5]\n")),
        (
            "world.toml",
            "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"*\"\n\
             uniform = { from = 0.9, to = 1.1 }\nrelative = true\n",
        ),
    ];
    for (name, text) in files {
        std::fs::write(folder.join(name), text).expect("a file");
    }
    let child = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .args([
            "run",
            "domain.pddl",
            "problem.pddl",
            "robots.plan",
            "--world",
        ])
        .args([
            "world.toml",
            "--executor",
            "policy",
            "--planning-budget",
            "1e9",
        ])
        .current_dir(&folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .expect("the command");
    wait_for_signal_handler(&child, 2);
    sleep(Duration::from_secs(1));
    send(&child, 2);
    let output = child.wait_with_output().expect("its output");
    assert_eq!(output.status.code(), Some(130));
}

const ROBOTS: &str = "(define (domain robots) (:requirements :durative-actions)
  (:predicates (idle ?r) (done ?r) (open))
  (:durative-action work :parameters (?r) :duration (= ?duration 5)
    :condition (and (at start (idle ?r)) (over all (open)))
    :effect (and (at start (not (idle ?r))) (at end (idle ?r)) (at end (done ?r)))))";

/// Uses a terminal made by `script` of util-linux; skipped if that is not installed.
#[test]
fn terminal_shows_search_progress() {
    let version = Command::new("script").arg("--version").output();
    if !version.is_ok_and(|output| output.stdout.starts_with(b"script from util-linux")) {
        skipped("there is no `script` of util-linux here");
        return;
    }
    let quoted = |text: String| format!("'{text}'");
    let arguments = Long::new("terminal").arguments().into_iter().map(quoted);
    let command = [env!("CARGO_BIN_EXE_elbowroom").to_owned()]
        .into_iter()
        .chain(arguments)
        .chain(["--time-limit".to_owned(), "2".to_owned()]);
    let output = Command::new("script")
        .args(["--quiet", "--return", "--command"])
        .arg(command.collect::<Vec<_>>().join(" "))
        .arg("/dev/null")
        .env("TERM", "xterm")
        .stdin(Stdio::null())
        .output()
        .expect("`script` runs");
    let shown = String::from_utf8_lossy(&output.stdout);
    assert!(shown.contains(" widenings"), "{shown}");
    assert!(output.status.success(), "{shown}");
}

/// The library's current step takes minutes when the time is up. Only the end of the program ends
/// it.
#[test]
fn the_region_of_a_long_plan_ends_at_its_time_limit() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("region");
    std::fs::create_dir_all(&folder).expect("a folder");
    let (domain, problem, plan) = chains::chains(4, 400, chains::Needs::Time);
    let names = ["domain.pddl", "problem.pddl", "long.plan"];
    for (name, text) in names.iter().zip([domain, problem, plan]) {
        std::fs::write(folder.join(name), text).expect("a file");
    }
    let output = Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .arg("envelope")
        .args(names.map(|name| folder.join(name)))
        .args(["--method", "exact", "--time-limit", "0.2", "--json"])
        .output()
        .expect("the command");
    let document: serde_json::Value =
        serde_json::from_slice(&output.stdout).expect("one JSON document");
    assert_eq!(document["answer"], "none", "{document}");
    assert_eq!(output.status.code(), Some(3), "{document}");
}
