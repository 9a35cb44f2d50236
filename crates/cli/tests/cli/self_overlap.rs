//! Self-overlap in found plans, given plans, and answers without a plan.

use std::fs;
use std::path::PathBuf;

use crate::command::elbowroom;

const DOMAIN: &str = "
    (define (domain hands)
      (:requirements :durative-actions :fluents)
      (:predicates (lifted))
      (:functions (hands) (baked))
      (:durative-action hold :parameters () :duration (= ?duration 2)
        :condition (at start (< (hands) 2))
        :effect (and (at start (increase (hands) 1)) (at end (decrease (hands) 1))))
      (:durative-action bake :parameters () :duration (= ?duration 2)
        :effect (at end (increase (baked) 1)))
      (:action lift :parameters () :precondition (>= (hands) 2) :effect (lifted)))";

fn file(name: &str, text: &str) -> String {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("self-overlap");
    fs::create_dir_all(&folder).expect("a folder for the test");
    let path = folder.join(name);
    fs::write(&path, text).expect("the folder can be written to");
    path.display().to_string()
}

fn problem(name: &str, goal: &str) -> String {
    let text = format!(
        "(define (problem one) (:domain hands) (:init (= (hands) 0) (= (baked) 0)) (:goal {goal}))"
    );
    file(name, &text)
}

/// Returns the exit code and all output.
fn code_and_output(arguments: &[&str]) -> (Option<i32>, String) {
    let output = elbowroom(arguments);
    let text = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
    (output.status.code(), text.concat())
}

#[test]
fn plan_that_needs_self_overlap_is_made_only_with_the_option() {
    let domain = file("needs.d.pddl", DOMAIN);
    let problem = problem("needs.p.pddl", "(lifted)");
    for command in ["plan", "run"] {
        let (code, text) = code_and_output(&[command, &domain, &problem]);
        assert_eq!(code, Some(3), "{command}: {text}");
        let expected = "no plan without self-overlap (`--self-overlap`)";
        let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(text.contains(expected), "{command}: {text}");
        let (code, text) = code_and_output(&[command, &domain, &problem, "--self-overlap"]);
        assert_eq!(code, Some(0), "{command}: {text}");
    }
}

#[test]
fn given_plan_that_overlaps_itself_is_executed_with_the_warning_of_check() {
    let domain = file("given.d.pddl", DOMAIN);
    let problem = problem("given.p.pddl", "(lifted)");
    let plan = file("given.plan", "0: (hold) [2]\n0.5: (hold) [2]\n1: (lift)\n");
    for command in ["check", "run"] {
        let (code, text) = code_and_output(&[command, &domain, &problem, &plan]);
        assert_eq!(code, Some(0), "{command}: {text}");
        let expected = "(hold) overlaps itself: it starts at 0.5";
        assert!(text.contains(expected), "{command}: {text}");
    }
    let apart = file("apart.plan", "0: (hold) [2]\n2: (hold) [2]\n");
    let (_, text) = code_and_output(&["check", &domain, &problem, &apart]);
    assert!(!text.contains("overlaps itself"), "{text}");
}

#[test]
fn executed_plan_keeps_instances_apart_when_the_first_one_takes_longer() {
    let domain = file("late.d.pddl", DOMAIN);
    let problem = problem("late.p.pddl", "(>= (baked) 2)");
    let world = file(
        "late.toml",
        "format = \"elbowroom-world\"\nversion = 1\n\n[[duration]]\naction = \"bake\"\nuniform = { from = 3, to = 4 }\n",
    );
    for executor in [
        "guarded",
        "live",
        "esterel",
        "stn",
        "adaptable",
        "lookahead",
        "policy",
    ] {
        let trace = file(&format!("{executor}.jsonl"), "");
        let (code, text) = code_and_output(&[
            "run",
            &domain,
            &problem,
            "--world",
            &world,
            "--executor",
            executor,
            "--trace",
            &trace,
        ]);
        assert_eq!(code, Some(0), "{executor}: {text}");
        let mut running = false;
        for line in fs::read_to_string(&trace).expect("a trace").lines() {
            if !line.starts_with("{\"event\":\"observed\"") {
                continue;
            }
            if line.contains("\"type\":\"started\"") {
                assert!(!running, "{executor}: {line}");
                running = true;
            } else if line.contains("\"type\":\"ended\"") {
                running = false;
            }
        }
    }
}
