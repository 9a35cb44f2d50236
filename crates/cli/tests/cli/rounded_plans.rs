//! All commands give the same verdict on rounded plans, and VAL can read written plans.

use crate::command;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use crate::command::elbowroom;
use crate::skipped::skipped;

/// Writes a problem with a patrol: a move of `(/ distance speed)`, then a watch of 2 to 9.
fn patrol(name: &str, distance: &str, speed: &str) -> [String; 2] {
    let domain = "
        (define (domain patrol)
          (:requirements :typing :durative-actions :fluents :duration-inequalities)
          (:types place)
          (:predicates (at-place ?p - place) (watched ?p - place))
          (:functions (distance ?a ?b - place) (speed))
          (:durative-action move :parameters (?a ?b - place)
            :duration (= ?duration (/ (distance ?a ?b) (speed)))
            :condition (at start (at-place ?a))
            :effect (and (at start (not (at-place ?a))) (at end (at-place ?b))))
          (:durative-action watch :parameters (?p - place)
            :duration (and (>= ?duration 2) (<= ?duration 9))
            :condition (and (at start (at-place ?p)) (over all (at-place ?p)))
            :effect (at end (watched ?p))))";
    let problem = format!(
        "(define (problem one) (:domain patrol) (:objects a b c - place)
           (:init (at-place a) (= (speed) {speed})
                  (= (distance a b) {distance}) (= (distance b c) {distance}) (= (distance a c) 999))
           (:goal (and (watched b) (watched c))))"
    );
    [("d", domain.to_owned()), ("p", problem)].map(|(kind, text)| {
        let path = folder().join(format!("{name}.{kind}.pddl"));
        fs::write(&path, text).expect("the folder can be written to");
        path.display().to_string()
    })
}

fn folder() -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("rounded-plans");
    fs::create_dir_all(&folder).expect("a folder for the test");
    folder
}

fn written(name: &str, text: &str) -> String {
    let path = folder().join(name);
    fs::write(&path, text).expect("the folder can be written to");
    path.display().to_string()
}

fn text(output: &Output) -> String {
    let [out, err] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    format!("{out}{err}")
}

/// Returns the exit codes and the output of `check`, `envelope`, `stn` and `run`.
fn verdicts(files: [&str; 3], options: &[&str]) -> Vec<(Option<i32>, String)> {
    let commands = ["check", "envelope", "stn", "run"];
    let verdicts = commands.map(|name| {
        let own: &[&str] = if name == "run" {
            &["--planner", "none"]
        } else {
            &[]
        };
        let output = elbowroom(&[&[name], &files[..], options, own].concat());
        (output.status.code(), text(&output))
    });
    verdicts.into()
}

#[test]
fn every_command_gives_the_verdict_of_check_and_points_to_repairs() {
    let [domain, problem] = patrol("verdicts", "5", "1");
    for (name, times, options, expected) in [
        ("exact", ["5.000", "5.001", "7.001", "12.002"], &[][..], 0),
        ("above", ["5.0001", "5.001", "7.001", "12.002"], &[], 0),
        ("below", ["4.9999", "5.001", "7.001", "12.002"], &[], 0),
        ("tenfold", ["50", "50.001", "52.001", "57.002"], &[], 1),
        ("short", ["1", "5.001", "7.001", "12.002"], &[], 1),
        ("beyond", ["5.0011", "5.002", "7.002", "12.003"], &[], 1),
        ("early", ["5", "4.8", "7.001", "12.002"], &[], 1),
        (
            "tolerated",
            ["5.1", "5.101", "7.101", "12.102"],
            &["--tolerance", "0.1"],
            0,
        ),
        (
            "not-tolerated",
            ["5.0001", "5.001", "7.001", "12.002"],
            &["--tolerance", "0"],
            1,
        ),
    ] {
        let [duration, watch, next, last] = times;
        let plan = written(
            &format!("{name}.plan"),
            &format!(
                "0: (move a b) [{duration}]\n{watch}: (watch b) [2.000]\n\
                 {next}: (move b c) [5]\n{last}: (watch c) [2]\n"
            ),
        );
        for (code, said) in verdicts([&domain, &problem, &plan], options) {
            assert_eq!(code, Some(expected), "{name}: {said}");
            assert_eq!(said.contains("--repair"), expected == 1, "{name}: {said}");
            let is_noted = said.contains("which are assumed to be rounded");
            assert_eq!(is_noted, expected == 0 && name != "exact", "{name}: {said}");
        }
    }
}

#[test]
fn known_plans_with_wrong_numbers_get_one_verdict() {
    let shared = std::env::var_os("ELBOWROOM_SHARED")
        .map_or_else(|| command::root().join("../shared"), PathBuf::from);
    let reports = shared.join("data/bug-reports");
    if !reports.is_dir() {
        skipped("no bug reports; set ELBOWROOM_SHARED to where they are");
        return;
    }
    for (name, expected) in [
        ("15-duration-mismatch", 1),
        ("27a-tenfold", 1),
        ("27b-too-short", 1),
        ("27d-range-below", 1),
        ("27e-order-wrong", 1),
        ("27f-overlap", 1),
        ("27g-same-time", 1),
        ("27j-dur-rounding", 0),
        ("27k-dur-and-order", 1),
    ] {
        let files = ["d.pddl", "p.pddl", "x.plan"].map(|file| reports.join(name).join(file));
        let files = files
            .each_ref()
            .map(|file| file.to_str().expect("a path in UTF-8"));
        for (code, said) in verdicts(files, &[]) {
            assert_eq!(code, Some(expected), "{name}: {said}");
        }
    }
}

/// The repair states if the plan needs other times.
#[test]
fn repair_says_whether_the_plan_needs_other_times() {
    let [domain, problem] = patrol("repaired", "5", "1");
    let plan = |first: &str| {
        format!(
            "0: (move a b) [{first}]\n50: (watch b) [2]\n52.001: (move b c) [5]\n57.002: (watch c) [2]\n"
        )
    };
    for (name, first, expected) in [
        ("kept.plan", "5", "and nothing has to change"),
        ("stretched.plan", "49", "with the times and durations below"),
    ] {
        let plan = written(name, &plan(first));
        let output = elbowroom(&["envelope", &domain, &problem, &plan, "--repair"]);
        let said = text(&output).replace("\n  ", " ");
        assert!(said.contains(expected), "{name}: {said}");
        assert_eq!(output.status.code(), Some(0), "{name}");
    }
}

fn val(program: &Path, files: [&str; 3]) -> String {
    let output = Command::new(program)
        .args(["-t", "0.001"])
        .args(files)
        .stdin(Stdio::null())
        .output()
        .expect("ELBOWROOM_VAL names a program");
    text(&output)
}

#[test]
fn plans_are_written_in_decimals_that_val_accepts() {
    let program = std::env::var_os("ELBOWROOM_VAL").map(PathBuf::from);
    if program.is_none() {
        skipped("no VAL; set ELBOWROOM_VAL to its program Validate");
    }
    for (distance, speed) in [
        ("10", "3"),
        ("1", "7"),
        ("0.5", "0.3"),
        ("123456", "17"),
        ("10", "2.9999999"),
        ("3.3333333333333335", "1"),
        ("0.01", "3"),
    ] {
        let name = format!("val-{distance}-{speed}");
        let [domain, problem] = patrol(&name, distance, speed);
        let plan = folder().join(format!("{name}.plan")).display().to_string();
        let planned = elbowroom(&["plan", &domain, &problem, "-o", &plan]);
        assert_eq!(planned.status.code(), Some(0), "{}", text(&planned));
        let lines = fs::read_to_string(&plan).expect("the plan was written");
        assert!(!lines.contains('/'), "{lines}");
        for (code, said) in verdicts([&domain, &problem, &plan], &[]) {
            assert_eq!(code, Some(0), "{said}");
        }
        if let Some(program) = &program {
            let said = val(program, [&domain, &problem, &plan]);
            assert!(said.contains("Plan valid"), "{name}: {said}\n{lines}");
        }
    }
}

#[test]
fn exact_plan_has_fractions() {
    let [domain, problem] = patrol("exact", "10", "3");
    let planned = elbowroom(&["plan", &domain, &problem, "--exact"]);
    let lines = text(&planned);
    assert!(lines.contains("[10/3]"), "{lines}");
    let plan = written("fractions.plan", &String::from_utf8_lossy(&planned.stdout));
    for (code, said) in verdicts([&domain, &problem, &plan], &["--tolerance", "0"]) {
        assert_eq!(code, Some(0), "{said}");
    }
}
