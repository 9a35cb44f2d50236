//! Time and memory limits of `elbowroom plan` hold for all its phases.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use crate::command::elbowroom;
use serde_json::Value;

/// A folder that no other test uses, removed on drop.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let name = format!("elbowroom-{}-limits-{name}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        fs::create_dir_all(&folder).expect("a temporary folder can be made");
        Self(folder)
    }

    fn file(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }

    fn write(&self, name: &str, text: &str) -> String {
        fs::write(self.0.join(name), text).expect("a temporary file can be written");
        self.file(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Returns the answer of a search that ends at a limit without a plan.
fn limited(arguments: &[&str]) -> Value {
    let output = elbowroom(&[&["plan", "--json"], arguments].concat());
    assert_eq!(output.status.code(), Some(3), "{output:?}");
    serde_json::from_slice(&output.stdout).expect("one JSON document")
}

#[test]
fn endless_input_respects_the_time_limit() {
    let folder = Folder::new("endless");
    let domain = folder.file("domain.pddl");
    // A reader of the named pipe blocks until another process writes to it.
    let made = Command::new("mkfifo").arg(&domain).status();
    assert!(made.expect("mkfifo can be started").success());
    for planner in ["embedded", "sh -c 'true' {domain} {problem}"] {
        let answer = limited(&[
            &domain,
            "cases/delivery/problem.pddl",
            "--time-limit",
            "0.2",
            "--planner",
            planner,
        ]);
        assert_eq!(answer["answer"], "none", "{answer}");
        assert_eq!(answer["stop"], "time limit", "{answer}");
        let reason = answer["reason"].as_str().expect("words");
        assert!(
            reason.contains("before domain and problem were read"),
            "{reason}"
        );
    }
}

/// No search is needed, but there are 2 · 30³ ground actions.
#[test]
fn grounding_counts_towards_the_memory_limit() {
    let folder = Folder::new("many");
    let objects: Vec<String> = (0..30).map(|number| format!("o{number}")).collect();
    let domain = folder.write(
        "domain.pddl",
        "(define (domain many) (:requirements :durative-actions)
           (:predicates (tied ?a ?b ?c) (done))
           (:durative-action tie :parameters (?a ?b ?c) :duration (= ?duration 1)
             :effect (at end (tied ?a ?b ?c)))
           (:durative-action end :parameters (?a ?b ?c) :duration (= ?duration 1)
             :condition (and (at start (tied ?a ?b ?c)) (at start (tied ?b ?c ?a)))
             :effect (at end (done))))",
    );
    let problem = folder.write(
        "problem.pddl",
        &format!(
            "(define (problem all) (:domain many) (:objects {}) (:init) (:goal (done)))",
            objects.join(" ")
        ),
    );
    let answer = limited(&[&domain, &problem, "--memory", "16"]);
    assert_eq!(answer["stop"], "memory limit", "{answer}");
    assert_eq!(answer["statistics"]["evaluated"], 0, "{answer}");
    let reason = answer["reason"].as_str().expect("words");
    assert!(reason.contains("memory limit of 16 MB"), "{reason}");
    let output = elbowroom(&["plan", &domain, &problem, "--memory", "2000"]);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
}
