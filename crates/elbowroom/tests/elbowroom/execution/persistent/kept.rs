//! Goals to keep.

use std::sync::Arc;

use elbowroom::execution::GoalTerms;
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::{Source, read_problem};

use super::scripted::{abandon, assert_has, fact, has, keep, pursue, pursue_on, run, task};

#[test]
fn goal_to_keep_is_achieved_again_whenever_it_does_not_hold() {
    let task = task("", "(have book)");
    let script = vec![
        (20, keep("cup", "(have cup)")),
        (50, fact(&task, "(have cup)", false)),
        (80, abandon("cup")),
        (90, fact(&task, "(have cup)", false)),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "20: `cup` pursued again",
            "20: start (fetch r cup)",
            "30: rest: goal-reached cup",
            "30: `cup` kept",
            "50: `cup` pursued again",
            "50: plan, because the goals have changed: `cup` does not hold and is to be kept",
            "50: start (fetch r cup)",
            "60: `cup` kept",
        ],
    );
    assert_eq!(
        (told.plans, told.report.starts),
        (3, 3),
        "{:#?}",
        told.notes
    );
}

#[test]
fn goal_to_keep_that_holds_needs_no_plan() {
    let task = task("", "(have book)");
    let told = run(&task, 100, vec![(20, keep("book", "(have book)"))]);
    assert_has(&told, &["20: `book` kept"]);
    assert_eq!(told.plans, 1, "{:#?}", told.notes);
}

#[test]
fn other_goals_are_pursued_before_goals_to_keep() {
    let task = task("", "(have book)");
    let script = vec![
        (20, keep("cup", "(have cup)")),
        (20, pursue("key", "(have key)")),
        (50, fact(&task, "(have cup)", false)),
        (55, pursue("book", "(and (have book) (have key))")),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "20: `cup` queued, because it does not hold, but other goals are pursued first",
            "20: start (fetch r key)",
            "30: `cup` pursued again",
            "30: start (fetch r cup)",
            "40: `cup` kept",
            "50: `cup` pursued again",
            "55: `cup` queued",
            "`cup` kept",
        ],
    );
}

#[test]
fn impossible_goal_to_keep_delays_no_other_goal() {
    let task = task("", "(have book)");
    let script = vec![
        (20, keep("never", "(not (here book))")),
        (40, pursue("cup", "(have cup)")),
        (70, pursue("key", "(have key)")),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "20: rest: unsolvable-from-here never",
            "40: `never` queued",
            "40: start (fetch r cup)",
            "50: rest: goal-reached cup",
            "rest: unsolvable-from-here never",
            "70: start (fetch r key)",
            "80: rest: goal-reached key",
        ],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
}

#[test]
fn goal_to_keep_is_pursued_although_another_goal_is_impossible() {
    let task = task("", "(have book)");
    let script = vec![
        (20, pursue("never", "(not (here book))")),
        (40, keep("cup", "(have cup)")),
        (70, fact(&task, "(have cup)", false)),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "40: start (fetch r cup)",
            "50: `cup` kept",
            "start (fetch r cup)",
            "80: `cup` kept",
        ],
    );
    assert_eq!(told.report.starts, 3, "{:#?}", told.notes);
}

#[test]
fn goals_to_keep_that_exclude_each_other_are_not_achieved_alternately() {
    let task = task("", "(have book)");
    let script = vec![
        (20, keep("with", "(have cup)")),
        (20, keep("without", "(not (have cup))")),
        (90, fact(&task, "(have cup)", false)),
    ];
    let told = run(&task, 500, script);
    assert_has(
        &told,
        &[
            "`without` queued",
            "`with` kept",
            "90: `with` pursued again",
        ],
    );
    assert!(
        has(&told, "exclude each other") || has(&told, "no plan"),
        "{:#?}",
        told.notes
    );
    assert!(
        told.report.starts <= 3 && told.plans <= 12,
        "{:#?}",
        told.notes
    );
}

/// Each of the two goals to keep can be achieved at any time, and makes the other one false.
#[test]
fn kept_goal_that_holds_is_preferred_whenever_other_goals_are_added() {
    const ROOMS: &str = "(define (domain rooms) (:requirements :durative-actions :typing)
        (:types place item) (:predicates (at ?p - place) (free) (have ?x - item))
        (:durative-action go :parameters (?from ?to - place) :duration (= ?duration 10)
          :condition (and (at start (at ?from)) (at start (free)))
          :effect (and (at start (not (free))) (at start (not (at ?from)))
                       (at end (free)) (at end (at ?to))))
        (:durative-action fetch :parameters (?x - item) :duration (= ?duration 10)
          :condition (at start (free))
          :effect (and (at start (not (free))) (at end (free)) (at end (have ?x)))))";
    const PROBLEM: &str =
        "(define (problem p) (:domain rooms) (:objects a b - place book cup key - item)
        (:init (at a) (free)) (:goal (have book)))";
    let read = read_problem(&Source::new("d", ROOMS), &Source::new("p", PROBLEM));
    let task = Arc::new(Task::new(read.expect("a correct problem").0));
    let script = vec![
        (20, keep("a", "(at a)")),
        (20, keep("b", "(at b)")),
        (60, pursue("cup", "(have cup)")),
        (100, pursue("key", "(have key)")),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &["`b` queued", "start (fetch cup)", "start (fetch key)"],
    );
    assert!(!has(&told, "start (go"), "{:#?}", told.notes);
}

#[test]
fn conflicting_goal_to_keep_is_pursued_once_the_other_is_abandoned() {
    let task = task("", "(have book)");
    let script = vec![
        (20, keep("without", "(not (have key))")),
        (30, keep("with", "(have key)")),
        (90, abandon("without")),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "`with` queued",
            "90: `with` pursued again",
            "90: start (fetch r key)",
            "100: `with` kept",
        ],
    );
    assert_eq!(told.report.starts, 2, "{:#?}", told.notes);
}

#[test]
fn goal_to_keep_has_a_release_time_and_no_deadline() {
    let task = task("", "(have book)");
    let terms = GoalTerms {
        keep: true,
        ..GoalTerms::default()
    };
    let time = Some(Rational::from(60));
    let late = GoalTerms {
        deadline: time.clone(),
        ..terms.clone()
    };
    let released = GoalTerms {
        release: time,
        ..terms
    };
    let script = vec![
        (20, pursue_on("key", "(have key)", late)),
        (20, pursue_on("cup", "(have cup)", released)),
    ];
    let told = run(&task, 200, script);
    assert_has(
        &told,
        &[
            "20: a goal to keep cannot have a deadline",
            "60: `cup` pursued again",
            "70: `cup` kept",
        ],
    );
    assert!(
        !has(&told, "fetch r key") && !has(&told, "fetch s key"),
        "{:#?}",
        told.notes
    );
}
