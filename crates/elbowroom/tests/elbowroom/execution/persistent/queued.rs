//! Goals with release times.

use elbowroom::execution::{Event, Request};

use super::scripted::{abandon, assert_has, has, pursue, pursue_from, run, task};

#[test]
fn goal_is_not_planned_for_before_its_release_time() {
    let task = task("", "(have book)");
    let told = run(
        &task,
        100,
        vec![(5, pursue_from("cup", "(have cup)", 40, None))],
    );
    assert_has(
        &told,
        &[
            "start (fetch r book)",
            "rest: goal-reached problem",
            "40: `cup` released",
            "40: plan, because the goals have changed: `cup` is released",
            "40: start (fetch r cup)",
            "50: rest: goal-reached cup",
        ],
    );
    assert_eq!(
        (told.plans, told.report.starts),
        (2, 2),
        "{:#?}",
        told.notes
    );
}

#[test]
fn goal_that_is_released_during_a_plan_is_added_to_it() {
    let task = task("", "(and (have book) (have cup) (have key))");
    let told = run(
        &task,
        100,
        vec![(1, pursue_from("more", "(have cup)", 5, None))],
    );
    assert_has(
        &told,
        &[
            "5: `more` released",
            "5: the plan is kept",
            "rest: goal-reached",
        ],
    );
    assert_eq!(told.plans, 1, "{:#?}", told.notes);
}

#[test]
fn goal_with_release_time_in_the_past_is_pursued_at_once() {
    let task = task("", "(have book)");
    let told = run(
        &task,
        100,
        vec![(40, pursue_from("cup", "(have cup)", 20, None))],
    );
    assert_has(&told, &["40: plan", "40: start (fetch r cup)"]);
    assert!(!has(&told, "released"), "{:#?}", told.notes);
}

#[test]
fn queued_goal_is_abandoned_or_replaced_without_a_plan() {
    let task = task("", "(have book)");
    let script = vec![
        (20, pursue_from("cup", "(have cup)", 40, None)),
        (21, pursue_from("key", "(have key)", 40, None)),
        (22, abandon("cup")),
        (23, pursue_from("key", "(have key)", 60, None)),
        (24, abandon("cup")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "24: there is no open goal with this name",
            "60: `key` released",
            "60: start (fetch",
        ],
    );
    assert!(
        !has(&told, "fetch r cup") && !has(&told, "40:"),
        "{:#?}",
        told.notes
    );
    assert_eq!(told.plans, 2, "{:#?}", told.notes);
}

#[test]
fn open_goal_that_is_queued_again_is_not_pursued_until_then() {
    let task = task("", "(have book)");
    let script = vec![
        (20, pursue("cup", "(and (have cup) (have key))")),
        (
            22,
            pursue_from("cup", "(and (have cup) (have key))", 50, None),
        ),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "20: start (fetch",
            "rest: no goals",
            "50: `cup` released",
            "60: rest: goal-reached cup",
        ],
    );
}

#[test]
fn deadline_counts_after_release() {
    let task = task("", "(have book)");
    let script = vec![
        (15, pursue_from("cup", "(have cup)", 20, Some(40))),
        (15, pursue_from("key", "(have key)", 50, Some(55))),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "20: `cup` released",
            "30: `cup` achieved",
            "50: `key` released",
            "55: `key` failed",
        ],
    );
}

#[test]
fn goal_that_is_released_during_a_pause_is_pursued_afterwards() {
    let task = task("", "(have book)");
    let script = vec![
        (15, pursue_from("cup", "(have cup)", 20, None)),
        (18, Event::Requested(Request::Pause)),
        (35, Event::Requested(Request::Resume)),
    ];
    let told = run(&task, 100, script);
    assert_has(&told, &["20: `cup` released", "35: start (fetch r cup)"]);
}
