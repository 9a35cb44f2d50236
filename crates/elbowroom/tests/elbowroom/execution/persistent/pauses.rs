//! Pauses of a run.

use elbowroom::execution::{Ending, Event, Request};
use elbowroom::num::Rational;

use super::scripted::{assert_has, fact, pursue, run, task};

#[test]
fn pause_starts_nothing_and_running_actions_continue() {
    let task = task("", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Requested(Request::Pause)),
        (7, pursue("key", "(have key)")),
        (50, Event::Requested(Request::Resume)),
    ];
    let told = run(&task, 100, script);
    let starts = |from: i64, to: i64| {
        let steps = told.report.executed.iter().map(|it| it.step.start.clone());
        let meanwhile = |it: &Rational| *it >= Rational::from(from) && *it < Rational::from(to);
        steps.filter(meanwhile).count()
    };
    assert_eq!(
        (starts(0, 5), starts(5, 50), starts(50, 100)),
        (1, 0, 2),
        "{:#?}",
        told.notes
    );
    assert_eq!(told.report.executed[0].ending, Some(Ending::Succeeded));
    assert_has(&told, &["50: plan", "rest: goal-reached key"]);
}

#[test]
fn pause_across_deadline_reports_missed_deadline() {
    let task = task("(at 40 (not (power)))", "(and (have book) (have cup))");
    let script = vec![
        (5, Event::Requested(Request::Pause)),
        (50, Event::Requested(Request::Resume)),
        (60, fact(&task, "(power)", true)),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "50: plan",
            "rest: unsolvable-from-here problem",
            "60: plan",
            "rest: goal-reached",
        ],
    );
}
