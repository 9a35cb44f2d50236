//! Runs that end with their goal, and that can be paused and abandoned.

use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Event, Request};
use elbowroom::num::Rational;

use super::scripted::{abandon, assert_has, has, pursue, run_interactive, task};

#[test]
fn interactive_run_ends_with_its_goal_and_rejects_others() {
    let task = task("", "(and (have book) (have cup))");
    let told = run_interactive(&task, 100, vec![(5, pursue("key", "(have key)"))]);
    assert_has(&told, &["accepts no other goals", "start"]);
    assert_eq!(told.report.verdict, Verdict::GoalReached);
    assert!(!has(&told, "key"), "{:#?}", told.notes);
    assert_eq!(told.plans, 1);
}

#[test]
fn interactive_run_with_abandoned_goal_ends_after_running_actions() {
    let task = task("", "(and (have book) (have cup))");
    let told = run_interactive(&task, 100, vec![(5, abandon("problem"))]);
    let starts = told.notes.iter().filter(|it| it.contains("start"));
    assert_eq!(starts.count(), 1, "{:#?}", told.notes);
    assert!(!has(&told, "cancel") && !has(&told, "rest"));
    assert_eq!(told.report.verdict, Verdict::Interrupted);
    assert_eq!(told.report.time, Rational::from(10));
    assert_eq!(told.report.executed.len(), 1);
}

#[test]
fn interactive_run_can_be_paused_between_actions() {
    let task = task("", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Requested(Request::Pause)),
        (30, Event::Requested(Request::Resume)),
    ];
    let told = run_interactive(&task, 100, script);
    assert_has(&told, &["0: start", "30"]);
    assert_eq!(told.report.verdict, Verdict::GoalReached);
    assert!(
        told.report.time >= Rational::from(40),
        "{}",
        told.report.time
    );
    // Abandoning the goal during a pause also ends the run.
    let script = vec![
        (5, Event::Requested(Request::Pause)),
        (6, abandon("problem")),
        (30, Event::Requested(Request::Resume)),
    ];
    let told = run_interactive(&task, 100, script);
    assert_eq!(told.report.verdict, Verdict::Interrupted);
}
