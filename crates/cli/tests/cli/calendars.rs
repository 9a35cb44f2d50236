//! Runs on a wall clock with calendars that begin now.

use std::fs;
use std::path::{Path, PathBuf};

use crate::command::{elbowroom, root};

/// Creates a folder with a calendar in this time unit. The bakery of the case is always open.
fn calendar(name: &str, unit: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("calendars");
    fs::create_dir_all(&folder).expect("a folder");
    let file = folder.join(name);
    let text = format!(
        "format = \"elbowroom-calendar\"\nversion = 1\ntime_zone = \"UTC\"\nunit = \"{unit}\"\n\
         horizon = \"7 days\"\n[[window]]\nfact = \"(open _)\"\nhours = \"0 to 24\"\n\
         [[value]]\nfluent = \"(tariff)\"\nvalue = 0.3\n"
    );
    fs::write(&file, text).expect("a file");
    file
}

/// Runs the case with a calendar. Returns standard error and the exit code.
fn run(calendar: &Path, others: &[&str]) -> (String, Option<i32>) {
    let case = root().join("examples/market");
    let file = |name: &str| case.join(name).display().to_string();
    let (domain, problem) = (file("domain.pddl"), file("problem.pddl"));
    let calendar = calendar.display().to_string();
    let mut line = vec!["run", &domain, &problem, "--calendar", &calendar];
    line.extend(others);
    let output = elbowroom(&line);
    let text = String::from_utf8(output.stderr).expect("text");
    (text, output.status.code())
}

#[test]
fn run_on_a_wall_clock_begins_now() {
    let file = calendar("seconds.toml", "seconds");
    let (text, code) = run(&file, &["--realtime", "1000"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(text.contains("note: time 0 is "), "{text}");
    assert!(
        text.contains("its time passes 1000 times as fast"),
        "{text}"
    );
}

#[test]
fn run_without_a_clock_needs_a_begin() {
    let file = calendar("minutes.toml", "minutes");
    let (text, code) = run(&file, &[]);
    assert_eq!(code, Some(2), "{text}");
    assert!(text.contains("`begin` is missing"), "{text}");
    let (text, code) = run(&file, &["--begin", "2026-12-23T16:30"]);
    assert_eq!(code, Some(0), "{text}");
    assert!(
        text.contains("time 0 is Wed 2026-12-23 16:30 +00:00 (UTC)"),
        "{text}"
    );
    assert!(!text.contains("warning"), "{text}");
}

/// The trace contains the problem with the timed initials.
#[test]
fn replay_needs_no_calendar() {
    let file = calendar("replayed.toml", "minutes");
    let trace = file.with_extension("jsonl").display().to_string();
    let (text, code) = run(&file, &["--begin", "2026-12-23T16:30", "--trace", &trace]);
    assert_eq!(code, Some(0), "{text}");
    let replayed = elbowroom(&["run", "--replay", &trace]);
    assert!(replayed.status.success(), "{replayed:?}");
    let file = file.display().to_string();
    let refused = elbowroom(&["run", "--replay", &trace, "--calendar", &file]);
    assert_eq!(refused.status.code(), Some(2));
}
