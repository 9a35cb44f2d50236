//! Runs that are killed at any moment, executive and world, and go on with `--resume`.
//!
//! `ELBOWROOM_KILLS=1000 cargo test --workspace --test kills -- --nocapture` makes a thousand of
//! them.

#![allow(
    clippy::print_stdout,
    reason = "how often runs were killed is worth seeing"
)]

mod command;
#[path = "../../../testing/skipped.rs"]
mod skipped;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use command::{elbowroom, root};
use skipped::skipped;

const ERRANDS: [&str; 3] = [
    "crates/cli/tests/files/errands/domain.pddl",
    "crates/cli/tests/files/errands/problem.pddl",
    "crates/cli/tests/files/errands/plan.plan",
];

fn python_is_there() -> bool {
    let is_there = Command::new("python3").arg("--version").output().is_ok();
    if !is_there {
        skipped("there is no python3");
    }
    is_there
}

/// How many runs there are at a time.
const WORKERS: u8 = 4;

/// A folder that no other test uses.
fn folder(name: &str) -> PathBuf {
    let name = format!("elbowroom-{}-{name}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir(&folder).expect("a folder can be made");
    folder
}

/// The command that begins a run in this folder.
fn beginning(folder: &Path, journal: &str) -> Vec<String> {
    let world = format!(
        "python3 crates/cli/tests/files/robot.py {}",
        folder.display()
    );
    let line = [
        "run",
        ERRANDS[0],
        ERRANDS[1],
        ERRANDS[2],
        "--world-process",
        &world,
    ];
    let line = line
        .into_iter()
        .chain(["--max-replans", "100", "--journal", journal]);
    line.map(str::to_owned).collect()
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

/// Numbers that look random: the upper bits of a linear congruential generator.
struct Dice(u64);

impl Dice {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }
}

/// The output of a program that must end by itself.
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

fn kill_the_world(folder: &Path) {
    let Ok(pid) = fs::read_to_string(folder.join("pid")) else {
        return;
    };
    let _ = Command::new("kill").args(["-9", pid.trim()]).output();
}

fn lines(folder: &Path, file: &str) -> Vec<String> {
    let text = fs::read_to_string(folder.join(file)).unwrap_or_default();
    text.lines().map(str::to_owned).collect()
}

/// Nothing was begun twice, and what counts as done was done.
fn judge(folder: &Path, output: &Output, what: &str) {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(0), "{what}: {text}{errors}");
    assert!(text.contains("goal reached"), "{what}: {text}");
    judge_what_was_done(folder, what, &text);
}

/// What the robot itself has written down.
fn judge_what_was_done(folder: &Path, what: &str, text: &str) {
    let begun = lines(folder, "begun");
    let tickets: BTreeSet<_> = begun
        .iter()
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert_eq!(
        tickets.len(),
        begun.len(),
        "{what}: begun twice: {begun:#?}"
    );
    let done = lines(folder, "done").join("\n");
    for errand in ["a1)", "a2)", "a3)", "b1)", "b2)", "b3)"] {
        assert!(
            done.contains(errand),
            "{what}: {errand} was never done:\n{done}\n{text}"
        );
    }
}

/// Kills a run up to three times, and has it go on each time.
fn killed(number: u64) -> u64 {
    let (folder, mut dice) = (folder(&format!("kill-{number}")), Dice(number));
    dice.below(2);
    let journal = folder.join("journal").display().to_string();
    let resume = ["run".to_owned(), "--resume".to_owned(), journal.clone()];
    let (mut kills, most) = (0, 1 + dice.below(3));
    let output = loop {
        // A journal without a first record is that of a run that never began.
        let has_begun = fs::read_to_string(&journal).is_ok_and(|text| text.contains('\n'));
        let line = if has_begun {
            resume.to_vec()
        } else {
            let _ = fs::remove_file(&journal);
            beginning(&folder, &journal)
        };
        let what = format!("run {number} after {kills} kills");
        let mut child = started(&line);
        if kills == most {
            break awaited(child, &what);
        }
        std::thread::sleep(Duration::from_millis(dice.below(2000)));
        let world_too = dice.below(2) == 0;
        if world_too && dice.below(2) == 0 {
            // The world alone dies: the executive says so, and ends.
            kill_the_world(&folder);
            std::thread::sleep(Duration::from_millis(dice.below(50)));
        }
        if child.try_wait().expect("it can be asked").is_some() {
            let output = child.wait_with_output().expect("its output");
            if output.status.success() {
                break output;
            }
            let text = String::from_utf8_lossy(&output.stderr).into_owned();
            // It was killed after its last record.
            if text.contains("is over: goal-reached") {
                break output;
            }
            assert!(
                text.contains("world failed") || text.contains("cannot start"),
                "{what}: {text}"
            );
            kills += 1;
            continue;
        }
        let _ = child.kill();
        let _ = child.wait();
        kills += 1;
        if world_too {
            kill_the_world(&folder);
        }
    };
    let what = format!("run {number} after {kills} kills");
    if String::from_utf8_lossy(&output.stderr).contains("is over: goal-reached") {
        judge_what_was_done(&folder, &what, "it was over when it was killed");
    } else {
        judge(&folder, &output, &what);
    }
    let replayed = elbowroom(&["run", "--replay", &journal]);
    assert!(replayed.status.success(), "run {number}: {replayed:?}");
    fs::remove_dir_all(&folder).expect("the folder is there");
    kills
}

#[test]
fn whenever_a_run_is_killed_it_goes_on_and_nothing_is_started_twice() {
    if !python_is_there() {
        return;
    }
    let runs = std::env::var("ELBOWROOM_KILLS")
        .ok()
        .and_then(|runs| runs.parse().ok());
    let runs: u64 = runs.unwrap_or(20);
    // They mostly sleep.
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

/// What was on the disk before the disk was full can be gone on with; nothing else was started.
#[test]
fn a_journal_that_cannot_be_written_starts_nothing() {
    if !Path::new("/dev/full").exists() {
        skipped("there is no /dev/full");
        return;
    }
    let folder = folder("full");
    let output = started(&beginning(&folder, "/dev/full"))
        .wait_with_output()
        .expect("its output");
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{text}");
    assert!(
        text.contains("cannot write the journal /dev/full"),
        "{text}"
    );
    assert!(text.contains("nothing was started"), "{text}");
    assert!(lines(&folder, "begun").is_empty());
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// A limit on the size of files stands for a disk that fills up while the run is under way.
#[test]
fn when_the_disk_is_full_the_run_ends_in_order_and_can_go_on() {
    if !python_is_there() {
        return;
    }
    let folder = folder("fills");
    let journal = folder.join("journal").display().to_string();
    let program = env!("CARGO_BIN_EXE_elbowroom");
    // In the shell's units, so that the first record fits and not all of them do. The signal that
    // would end the program is ignored, and writing fails.
    let line = beginning(&folder, &journal)
        .iter()
        .map(|word| format!("'{word}'"))
        .collect::<Vec<_>>();
    let script = format!(
        "trap '' XFSZ; ulimit -f 8; exec '{program}' {}",
        line.join(" ")
    );
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(root())
        .output();
    let Ok(output) = output else {
        skipped("there is no bash");
        return;
    };
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(text.contains("the run was ended in order"), "{text}");
    let begun = lines(&folder, "begun").len();
    assert!((1..6).contains(&begun), "in the middle: {begun} begun");
    let resume = ["run".to_owned(), "--resume".to_owned(), journal];
    let output = awaited(started(&resume), "after the disk was full");
    judge(&folder, &output, "after the disk was full");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

/// Two that write one journal would start everything twice.
#[cfg(unix)]
#[test]
fn a_run_that_is_under_way_is_not_gone_on_with_beside_it() {
    if !python_is_there() {
        return;
    }
    let folder = folder("twice");
    let journal = folder.join("journal").display().to_string();
    let line = beginning(&folder, &journal);
    let first = started(&line);
    for _ in 0..600 {
        if !lines(&folder, "begun").is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let resume = ["run", "--resume", &journal].map(str::to_owned);
    for line in [&resume[..], &line] {
        let second = awaited(started(line), "the second");
        let text = String::from_utf8_lossy(&second.stderr).into_owned();
        assert_eq!(second.status.code(), Some(2), "{text}");
        assert!(text.contains("is under way"), "{text}");
    }
    judge(&folder, &awaited(first, "the first"), "the first");
    fs::remove_dir_all(&folder).expect("the folder is there");
}

#[test]
fn a_journal_is_neither_overwritten_nor_gone_on_with_after_its_end() {
    if !python_is_there() {
        return;
    }
    let folder = folder("over");
    let journal = folder.join("journal").display().to_string();
    let line = beginning(&folder, &journal);
    judge(&folder, &awaited(started(&line), "the run"), "the run");
    let again = awaited(started(&line), "the same again");
    let text = String::from_utf8_lossy(&again.stderr).into_owned();
    assert_eq!(again.status.code(), Some(2), "{text}");
    assert!(
        text.contains("there is a journal") && text.contains("--resume"),
        "{text}"
    );
    let resumed = elbowroom(&["run", "--resume", &journal]);
    let text = String::from_utf8_lossy(&resumed.stderr).into_owned();
    assert_eq!(resumed.status.code(), Some(2), "{text}");
    assert!(text.contains("is over: goal-reached"), "{text}");
    // It is a trace for whoever reads one.
    let report = elbowroom(&["report", &journal]);
    assert!(report.status.success(), "{report:?}");
    // Damage is not taken for a torn end.
    let text = fs::read_to_string(&journal).expect("the journal");
    fs::write(
        &journal,
        text.replacen("\"event\":\"decided\"", "\"event\":\"Decided\"", 1),
    )
    .expect("written");
    let damaged = elbowroom(&["run", "--resume", &journal]);
    let text = String::from_utf8_lossy(&damaged.stderr).into_owned();
    assert!(text.contains("damaged in the middle"), "{text}");
    fs::remove_dir_all(&folder).expect("the folder is there");
}
