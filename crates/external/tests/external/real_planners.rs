//! Third-party planners, if they are installed: `ELBOWROOM_LPG` is the path of LPG-td,
//! `ELBOWROOM_PYTHON` a Python with unified-planning and up-aries.
#![cfg(unix)]

use std::env;
use std::ops::ControlFlow;
use std::time::Duration;

use crate::skipped::skipped;
use elbowroom_external::{Event, Outcome, Planner, Report, Request, Settings, plan};
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;
use elbowroom_pddl::{Source, read_problem, write_plan};

const DOMAIN: &str = "(define (domain post)
    (:requirements :typing :durative-actions :fluents :timed-initial-literals)
    (:types place)
    (:predicates (at ?p - place) (road ?a ?b - place) (counter ?p - place)
      (open) (delivered) (still))
    (:functions (length ?a ?b - place) (charge))
    (:durative-action drive :parameters (?a ?b - place)
      :duration (= ?duration (length ?a ?b))
      :condition (and (at start (at ?a)) (at start (still)) (at start (road ?a ?b))
                      (at start (>= (charge) (length ?a ?b))))
      :effect (and (at start (not (at ?a))) (at start (not (still)))
                   (at start (decrease (charge) (length ?a ?b)))
                   (at end (at ?b)) (at end (still))))
    (:durative-action deliver :parameters (?p - place) :duration (= ?duration 2)
      :condition (and (at start (at ?p)) (at start (counter ?p)) (over all (at ?p)) (at end (open)))
      :effect (at end (delivered))))";

fn problem(length: &str, deadline: u32) -> String {
    format!(
        "(define (problem letter) (:domain post)
         (:objects home office - place)
         (:init (at home) (still) (counter office) (open) (road home office) (= (charge) 20)
                (= (length home office) {length}) (at {deadline} (not (open))))
         (:goal (and (delivered) (at office)))
         (:metric minimize (total-time)))"
    )
}

/// Returns the report, and the plan as text.
fn ask(planner: &str, problem: &str, start: i64) -> (Report, Option<String>) {
    let domain = Source::new("post.pddl", DOMAIN);
    let problem = Source::new("letter.pddl", problem);
    let problem_read = read_problem(&domain, &problem).expect("they are right").0;
    let task = Task::new(problem_read);
    let situation = Situation {
        time: Rational::from(start),
        ..Situation::initial(&task)
    };
    let settings = Settings {
        time_limit: Some(Duration::from_secs(20)),
        ..Settings::default()
    };
    let report = plan(
        &Planner::named(planner).expect("a known planner"),
        &mut Request {
            task: &task,
            situation: &situation,
            domain: &domain,
            problem: &problem,
        },
        &settings,
        &mut |_, _| None,
        &mut |event| match event {
            Event::Plan { .. } => ControlFlow::Break(()),
            _ => ControlFlow::Continue(()),
        },
    );
    let plan = report.outcome.found().map(|f| write_plan(&task, &f.plan));
    (report, plan)
}

/// Returns `true` if the environment variable names a planner.
fn is_there(variable: &str) -> bool {
    let is_there = env::var_os(variable).is_some_and(|path| !path.is_empty());
    if !is_there {
        skipped(format_args!("{variable} is not set"));
    }
    is_there
}

/// The actions of a plan without their times.
fn actions(plan: Option<&str>) -> Vec<String> {
    let inside = |line: &str| Some(line.split_once('(')?.1.split_once(')')?.0.to_owned());
    plan.unwrap_or_default()
        .lines()
        .filter_map(inside)
        .collect()
}

#[test]
fn lpg_finds_valid_plan() {
    if !is_there("ELBOWROOM_LPG") {
        return;
    }
    let (report, plan) = ask("lpg-td", &problem("7.5", 30), 0);
    let expected = ["drive home office", "deliver office"];
    // Its separations are smaller than ε. Without a repair, the validator objects.
    match report.outcome {
        Outcome::Plan(_) => assert_eq!(actions(plan.as_deref()), expected),
        Outcome::Refused { reason, .. } => assert!(reason.contains("0.001"), "{reason}"),
        other => panic!("{other:?}"),
    }
}

#[test]
fn lpg_without_a_plan_gives_up_or_runs_out_of_time() {
    if !is_there("ELBOWROOM_LPG") {
        return;
    }
    let (report, _) = ask("lpg-td", &problem("7", 5), 0);
    let name = report.outcome.name();
    assert!(
        ["gave up", "none in time", "unsolvable"].contains(&name),
        "{report:?}"
    );
}

#[test]
fn aries_plans_also_in_mid_execution() {
    if !is_there("ELBOWROOM_PYTHON") {
        return;
    }
    for start in [0, 12] {
        let (report, plan) = ask("up:aries", &problem("7", 30), start);
        assert!(plan.is_some(), "{report:?}");
        let expected = ["drive home office", "deliver office"];
        assert_eq!(actions(plan.as_deref()), expected);
        let found = report.outcome.found().expect("a plan");
        assert!(found.plan.steps[0].start >= Rational::from(start));
    }
}

#[test]
fn aries_rejects_non_integer_numbers() {
    if !is_there("ELBOWROOM_PYTHON") {
        return;
    }
    let (report, _) = ask("up:aries", &problem("7.5", 30), 0);
    assert_eq!(report.outcome.name(), "unsupported", "{report:?}");
}

#[test]
fn aries_proves_that_a_deadline_is_too_early() {
    if !is_there("ELBOWROOM_PYTHON") {
        return;
    }
    let (report, _) = ask("up:aries", &problem("7", 5), 0);
    let name = report.outcome.name();
    // It tries longer and longer plans, and may not stop.
    assert!(
        ["gave up", "none in time", "unsolvable"].contains(&name),
        "{report:?}"
    );
}

#[test]
fn missing_engine_is_reported() {
    if !is_there("ELBOWROOM_PYTHON") {
        return;
    }
    let (report, _) = ask("up:nobody", &problem("7", 30), 0);
    assert!(
        matches!(report.outcome, Outcome::NotStarted { .. }),
        "{report:?}"
    );
}
