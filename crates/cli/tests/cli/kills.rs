//! Runs whose executive, world or planner is killed after a random number of journal records, and which
//! are continued with `--resume`.
//!
//! `ELBOWROOM_KILLS=1000 cargo test --workspace --test cli kills:: -- --nocapture` makes a thousand of
//! them. The number of a run is the seed of these numbers.

#![allow(
    clippy::print_stdout,
    reason = "how often runs were killed is worth seeing"
)]

mod disks;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use crate::command::{elbowroom, root};
use crate::robots::{Rng, check_tickets, folder, lines, python_is_there, record_count};

const ERRANDS: [&str; 3] = [
    "crates/cli/tests/files/errands/domain.pddl",
    "crates/cli/tests/files/errands/problem.pddl",
    "crates/cli/tests/files/errands/plan.plan",
];

/// Maximum number of records between two kills. A run without kills writes about as many.
const MAX_RECORDS: u64 = 40;

/// Number of concurrent runs.
const WORKERS: u8 = 4;

/// Returns the command that begins a run in this folder. With a planner, it has no first plan.
fn beginning(folder: &Path, journal: &str, has_planner: bool) -> Vec<String> {
    let world = format!(
        "python3 crates/cli/tests/files/robot.py {}",
        folder.display()
    );
    let planner = format!(
        "sh crates/cli/tests/files/slow_planner.sh {} {} {{domain}} {{problem}}",
        folder.display(),
        env!("CARGO_BIN_EXE_elbowroom")
    );
    let mut line = vec!["run", ERRANDS[0], ERRANDS[1]];
    if has_planner {
        line.extend(["--planner", &planner]);
    } else {
        line.push(ERRANDS[2]);
    }
    line.extend(["--world-process", &world, "--max-replans", "100"]);
    line.extend(["--journal", journal]);
    line.into_iter().map(str::to_owned).collect()
}

fn started(line: &[String]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_elbowroom"))
        .current_dir(root())
        .env("NO_COLOR", "1")
        .args(line)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the command can be started")
}

/// Returns the output of a program that must end by itself.
fn awaited(mut child: Child, what: &str) -> Output {
    for _ in 0..1200 {
        if child.try_wait().expect("it can be asked").is_some() {
            return child.wait_with_output().expect("its output");
        }
        std::thread::sleep(Duration::from_millis(100));
    }
    let _ = child.kill();
    panic!("{what}: the run is stuck");
}

/// Kills the process whose number is in `file`, if its command line still contains `folder`.
/// Returns `true` if a process was killed.
fn kill_by(folder: &Path, file: &str) -> bool {
    let Ok(pid) = fs::read_to_string(folder.join(file)) else {
        return false;
    };
    let pid = pid.trim();
    let words = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
    let words = String::from_utf8_lossy(&words).into_owned();
    let is_there = words.contains(&folder.display().to_string());
    is_there && {
        let killed = Command::new("kill").args(["-9", pid]).output();
        killed.is_ok_and(|it| it.status.success())
    }
}

/// Process to kill.
#[derive(Clone, Copy, PartialEq)]
enum Victim {
    Executive,
    ExecutiveAndWorld,
    /// The executive reports it and ends.
    World,
    /// Killed as soon as it runs, within at most two seconds.
    Planner,
}

impl Victim {
    fn drawn(dice: &mut Rng, has_planner: bool) -> Self {
        if has_planner && dice.below(3) == 0 {
            return Self::Planner;
        }
        match dice.below(4) {
            0 => Self::World,
            1 => Self::ExecutiveAndWorld,
            _ => Self::Executive,
        }
    }

    /// Kills the process, unless it is the executive, which the caller kills.
    fn kill(self, folder: &Path, dice: &mut Rng) {
        match self {
            Self::Executive => {}
            Self::ExecutiveAndWorld | Self::World => {
                kill_by(folder, "pid");
            }
            Self::Planner => {
                for _ in 0..200 {
                    if kill_by(folder, "planner") {
                        break;
                    }
                    std::thread::sleep(Duration::from_millis(10));
                }
            }
        }
        if matches!(self, Self::World | Self::Planner) {
            std::thread::sleep(Duration::from_millis(dice.below(500)));
        }
    }
}

/// Waits until the journal has `count` records, or the run has ended.
fn wait_for_records(child: &mut Child, journal: &str, count: u64) {
    for _ in 0..60_000 {
        let has_ended = child.try_wait().expect("it can be asked").is_some();
        if has_ended || record_count(journal) >= count {
            return;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    let _ = child.kill();
    panic!("the run is stuck before record {count}");
}

/// Checks that nothing was started twice, and that everything reported as done was done.
fn check_outcome(folder: &Path, output: &Output, what: &str) {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{what}: {text}{errors}");
    assert!(text.contains("goal reached"), "{what}: {text}");
    check_robot_records(folder, what, &text);
}

/// Checks the robot's own records: each errand was done.
fn check_robot_records(folder: &Path, what: &str, text: &str) {
    check_starts(folder, what);
    let done = lines(folder, "done").join("\n");
    for errand in ["a1)", "a2)", "a3)", "b1)", "b2)", "b3)"] {
        assert!(
            done.contains(errand),
            "{what}: {errand} was never done:\n{done}\n{text}"
        );
    }
}

/// Checks that nothing was started twice: no ticket was started twice, and no finished errand was
/// done again under another ticket.
fn check_starts(folder: &Path, what: &str) {
    let mut done = BTreeMap::new();
    for line in lines(folder, "done") {
        let (ticket, errand) = line.split_once(' ').expect("a ticket and an errand");
        let first = done.entry(errand.to_owned()).or_insert(ticket.to_owned());
        assert_eq!(first, ticket, "{what}: {errand} was done, and done again");
    }
    check_tickets(folder, what);
}

/// Kills a run up to three times and resumes it each time. Every third run has a planner, which may
/// also be killed.
fn killed(number: u64) -> u64 {
    let (folder, mut dice) = (folder(&format!("kill-{number}")), Rng(number));
    dice.below(2);
    let has_planner = number % 3 == 2;
    let journal = folder.join("journal").display().to_string();
    let resume = ["run".to_owned(), "--resume".to_owned(), journal.clone()];
    let (mut kills, most) = (0, 1 + dice.below(3));
    let output = loop {
        // Without a first record, the run never began.
        let has_begun = record_count(&journal) > 0;
        let line = if has_begun {
            resume.to_vec()
        } else {
            let _ = fs::remove_file(&journal);
            beginning(&folder, &journal, has_planner)
        };
        let count = record_count(&journal) + dice.below(MAX_RECORDS);
        let what = format!("run {number} after {kills} kills, before record {count}");
        let mut child = started(&line);
        if kills == most {
            break awaited(child, &what);
        }
        let victim = Victim::drawn(&mut dice, has_planner);
        if victim != Victim::Planner {
            wait_for_records(&mut child, &journal, count);
        }
        victim.kill(&folder, &mut dice);
        kills += 1;
        if child.try_wait().expect("it can be asked").is_none() {
            if victim == Victim::Planner {
                // The planner is called once more, or is no longer needed because it has returned a
                // plan.
                break awaited(child, &what);
            }
            let _ = child.kill();
            let _ = child.wait();
            continue;
        }
        let output = child.wait_with_output().expect("its output");
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        // It was killed after its last record.
        if output.status.success() {
            break output;
        }
        assert!(
            text.contains("world failed") || text.contains("cannot start"),
            "{what}: {text}"
        );
    };
    let what = format!("run {number} after {kills} kills");
    check_end(&folder, &output, &what);
    let replayed = elbowroom(&["run", "--replay", &journal]);
    assert!(replayed.status.success(), "run {number}: {replayed:?}");
    fs::remove_dir_all(&folder).expect("the folder is there");
    kills
}

/// Checks that a run ended with its goal.
fn check_end(folder: &Path, output: &Output, what: &str) {
    if String::from_utf8_lossy(&output.stdout).contains("has already reached its goal") {
        check_robot_records(folder, what, "it was over when it was killed");
    } else {
        check_outcome(folder, output, what);
    }
}

/// A planner that dies is called once more. If it dies again, the run ends in order with the
/// reason, and can be resumed when there is a planner.
#[cfg(unix)]
#[test]
fn run_with_crashing_planner_ends_and_can_be_resumed() {
    if !python_is_there() {
        return;
    }
    let folder = folder("planner");
    let journal = folder.join("journal").display().to_string();
    let planner = format!(
        "sh crates/cli/tests/files/sick_planner.sh {} {} {{domain}} {{problem}}",
        folder.display(),
        env!("CARGO_BIN_EXE_elbowroom")
    );
    let mut line = beginning(&folder, &journal, true);
    let own = line.iter().position(|it| it == "--planner");
    line[own.expect("it has a planner") + 1] = planner;
    let resume = ["run", "--resume", &journal].map(str::to_owned);
    for (asked, line) in [(2, &line[..]), (4, &resume)] {
        let output = awaited(started(line), "the run");
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(text.contains("failed: the planner failed"), "{text}");
        assert!(said.contains("it crashed (SIGKILL"), "{said}");
        assert_eq!(lines(&folder, "asked").len(), asked, "{text}");
    }
    assert!(lines(&folder, "begun").is_empty());
    fs::write(folder.join("healthy"), "").expect("written");
    let last = awaited(started(&resume), "the rest");
    check_outcome(&folder, &last, "the rest");
    for what in [["run", "--replay", &journal], ["run", "--resume", &journal]] {
        let output = elbowroom(&what);
        assert!(output.status.success(), "{output:?}");
    }
    fs::remove_dir_all(&folder).expect("the folder is there");
}

#[test]
fn killed_run_resumes_without_starting_actions_twice() {
    if !python_is_there() {
        return;
    }
    let runs = std::env::var("ELBOWROOM_KILLS")
        .ok()
        .and_then(|runs| runs.parse().ok());
    let runs: u64 = runs.unwrap_or(20);
    // More workers than processors, because they mostly sleep.
    let workers: Vec<_> = (0..u64::from(WORKERS))
        .map(|worker| {
            let numbers = (worker..runs).step_by(usize::from(WORKERS));
            std::thread::spawn(move || numbers.map(killed).sum::<u64>())
        })
        .collect();
    let kills = workers
        .into_iter()
        .map(|worker| worker.join().expect("each run was right"));
    let kills: u64 = kills.sum();
    println!("{runs} runs, killed {kills} times");
}

/// Two programs with one journal would start everything twice.
#[cfg(unix)]
#[test]
fn running_run_cannot_be_resumed_concurrently() {
    if !python_is_there() {
        return;
    }
    let folder = folder("twice");
    let journal = folder.join("journal").display().to_string();
    let line = beginning(&folder, &journal, false);
    let first = started(&line);
    for _ in 0..600 {
        if !lines(&folder, "begun").is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let resume = ["run", "--resume", &journal].map(str::to_owned);
    // Both wait for the journal for a short time, which is less than the first run takes.
    for second in [started(&resume), started(&line)] {
        let second = awaited(second, "the second");
        let text = String::from_utf8_lossy(&second.stderr).into_owned();
        assert_eq!(second.status.code(), Some(2), "{text}");
        assert!(text.contains("has not ended"), "{text}");
    }
    check_outcome(&folder, &awaited(first, "the first"), "the first");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

#[test]
fn finished_journal_is_neither_overwritten_nor_resumed() {
    if !python_is_there() {
        return;
    }
    let folder = folder("over");
    let journal = folder.join("journal").display().to_string();
    let line = beginning(&folder, &journal, false);
    check_outcome(&folder, &awaited(started(&line), "the run"), "the run");
    let again = awaited(started(&line), "the same again");
    let text = String::from_utf8_lossy(&again.stderr).into_owned();
    assert_eq!(again.status.code(), Some(2), "{text}");
    assert!(
        text.contains("already exists") && text.contains("--resume"),
        "{text}"
    );
    let resumed = elbowroom(&["run", "--resume", &journal]);
    let text = String::from_utf8_lossy(&resumed.stdout).into_owned();
    assert_eq!(resumed.status.code(), Some(0), "{resumed:?}");
    assert!(text.contains("has already reached its goal"), "{text}");
    // The journal is also a valid trace.
    let report = elbowroom(&["report", &journal]);
    assert!(report.status.success(), "{report:?}");
    // Damage is distinguished from a truncated end.
    let text = fs::read_to_string(&journal).expect("the journal");
    let header = format!("{}\n", text.lines().next().expect("a record"));
    fs::write(
        &journal,
        text.replacen("\"event\":\"decided\"", "\"event\":\"Decided\"", 1),
    )
    .expect("written");
    let damaged = elbowroom(&["run", "--resume", &journal]);
    let text = String::from_utf8_lossy(&damaged.stderr).into_owned();
    assert!(text.contains("it is damaged: record 4 is intact"), "{text}");
    assert!(
        text.contains("help: the records after the damage"),
        "{text}"
    );
    // Only if no record is complete, no command can have been sent yet.
    for (kept, expected) in [
        (header.replace('\n', "\r\n"), "its first record is damaged"),
        (
            header[..60].to_owned(),
            "remove it, and start the run again",
        ),
    ] {
        fs::write(&journal, kept).expect("written");
        let refused = elbowroom(&["run", "--resume", &journal]);
        let text = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert_eq!(refused.status.code(), Some(2), "{text}");
        assert!(text.contains(expected), "{text}");
    }
    fs::remove_dir_all(&folder).expect("the folder is there");
}
