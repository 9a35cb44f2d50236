//! Goals that cannot all be reached together.

use std::sync::Arc;

use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};

use super::scripted::{
    abandon, assert_has, has, pursue, pursue_by, pursue_with_value, run, run_with_slow_action, task,
};

const NEVER: &str = "because (not (here book)) can never become true";

#[test]
fn an_impossible_goal_does_not_keep_the_others_from_being_reached() {
    let task = task("", "(have book)");
    let script = vec![
        (0, pursue("moon", "(not (here book))")),
        (0, pursue("cup", "(have cup)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "start (fetch r book)",
            &format!("`moon` set aside, {NEVER}"),
            "`problem` achieved",
            "start (fetch r cup)",
            "`cup` achieved",
            "rest: unsolvable-from-here moon",
        ],
    );
}

#[test]
fn goals_are_selected_if_no_plan_reaches_all_of_them_at_first() {
    let task = task("", "(and)");
    let script = vec![
        (0, pursue("moon", "(not (here book))")),
        (0, pursue("cup", "(have cup)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            &format!("`moon` set aside, {NEVER}"),
            "start (fetch r cup)",
            "`cup` achieved",
            "rest: unsolvable-from-here moon",
        ],
    );
}

#[test]
fn a_goal_that_is_achieved_is_closed_while_others_are_pursued() {
    let task = task("", "(have book)");
    let told = run(&task, 100, vec![(0, pursue("cup", "(have cup)"))]);
    assert_has(&told, &["achieved", "rest: goal-reached"]);
    assert!(
        !has(&told, "rest: goal-reached problem cup"),
        "{:#?}",
        told.notes
    );
}

#[test]
fn an_impossible_goal_that_is_given_later_leaves_the_plan_as_it_is() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 100, vec![(5, pursue("moon", "(not (here book))"))]);
    assert_has(
        &told,
        &[
            "0: start (fetch r book)",
            "5: `moon` set aside",
            "start (fetch r cup)",
            "rest: unsolvable-from-here moon",
        ],
    );
    assert!(!has(&told, "cancel"), "{:#?}", told.notes);
}

/// Returns a task with a robot that moves between rooms, in ten seconds each.
fn task_with_rooms(goal: &str) -> Arc<Task> {
    let domain = "(define (domain rooms) (:requirements :durative-actions :typing)
      (:types room) (:predicates (at ?x - room))
      (:durative-action move :parameters (?x ?y - room) :duration (= ?duration 10)
        :condition (at start (at ?x)) :effect (and (at start (not (at ?x))) (at end (at ?y)))))";
    let problem = format!(
        "(define (problem p) (:domain rooms) (:objects home lab ward - room)
           (:init (at home)) (:goal {goal}))"
    );
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(domain), &source(&problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

#[test]
fn goals_that_exclude_each_other_are_reached_one_after_the_other() {
    let script = vec![(0, pursue("ward", "(at ward)"))];
    let told = run(&task_with_rooms("(at lab)"), 100, script);
    assert_has(
        &told,
        &[
            "0: start (move home lab)",
            "0: `ward` set aside, because `(at lab)` and `(at ward)` exclude each other",
            "10: `problem` achieved",
            "10: `ward` pursued again",
            "start (move lab ward)",
            "rest: goal-reached ward",
        ],
    );
}

#[test]
fn goal_of_greater_value_replaces_pursued_goals() {
    let script = vec![
        (0, pursue_with_value("ward", "(at ward)", 5)),
        (50, pursue("home", "(at home)")),
        (50, pursue_with_value("lab", "(at lab)", 2)),
        (50, pursue_with_value("back", "(at ward)", 3)),
    ];
    let told = run(&task_with_rooms("(at lab)"), 100, script);
    assert_has(
        &told,
        &[
            "0: `problem` set aside, because `(at lab)` and `(at ward)` exclude each other",
            "10: `problem` achieved",
            "20: rest: goal-reached ward",
            "50: `back` achieved",
            "50: `home` set aside, because",
            "60: `lab` achieved",
            "rest: goal-reached home",
        ],
    );
}

#[test]
fn many_goals_are_reached_in_parts() {
    let names = ["lab", "ward"];
    let goal = |i: usize| {
        (
            0,
            pursue(&format!("g{i}"), &format!("(at {})", names[i % 2])),
        )
    };
    let told = run(
        &task_with_rooms("(at lab)"),
        200,
        (0..12).map(goal).collect(),
    );
    let achieved = told.notes.iter().filter(|it| it.ends_with("achieved"));
    assert_eq!(achieved.count(), 7, "{:#?}", told.notes);
    assert_has(&told, &["rest: goal-reached g1 g3 g5 g7 g9 g11"]);
    assert_eq!(told.report.starts, 2, "{:#?}", told.notes);
}

#[test]
fn a_goal_that_was_set_aside_is_pursued_again_when_another_one_is_abandoned() {
    let task = task("", "(have book)");
    let script = vec![
        (0, pursue("moon", "(not (here book))")),
        (5, abandon("problem")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &["0: `moon` set aside", "5: rest: unsolvable-from-here moon"],
    );
}

#[test]
fn goals_with_deadlines_are_reached_in_the_order_of_their_deadlines() {
    let script = vec![
        (0, pursue_by("ward", "(at ward)", 25)),
        (0, pursue_by("lab", "(at lab)", 15)),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(
        &told,
        &[
            "start (move home lab)",
            "10: `lab` achieved",
            "start (move lab ward)",
            "20: `ward` achieved",
            "20: rest: no goals",
        ],
    );
}

#[test]
fn lateness_of_a_single_goal_is_stated_with_its_certificate() {
    let script = vec![(0, pursue_by("ward", "(at ward)", 5))];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here ward: `ward` would be reached 5.001 s late: it cannot be reached before 10.001",
            "5: `ward` failed, because its deadline has passed; it would have been reached 5.001 s late: it cannot be reached before 10.001",
        ],
    );
}

/// In the delete relaxation one robot fetches all items at once, so the certified bound is 10.
#[test]
fn lateness_without_certificate_is_that_of_the_earliest_plan_found() {
    let all = "(and (have book) (have cup) (have key))";
    let told = run(
        &task("", "(and)"),
        100,
        vec![(0, pursue_by("all", all, 25))],
    );
    assert_has(
        &told,
        &[
            "25: `all` failed, because its deadline has passed; it would have been reached 5.003 s late: the earliest plan found reaches it at 30.003",
        ],
    );
    assert!(!has(&told, "cannot be reached"), "{:#?}", told.notes);
}

#[test]
fn conflict_of_three_goals_names_the_two_that_exclude_each_other() {
    let script = vec![
        (0, pursue("ward", "(at ward)")),
        (0, pursue("away", "(not (at home))")),
    ];
    let told = run(&task_with_rooms("(at lab)"), 100, script);
    assert_has(
        &told,
        &[
            "`ward` set aside, because `(at lab)` and `(at ward)` exclude each other",
            "`ward` pursued again",
            "rest: goal-reached ward",
        ],
    );
    assert!(!has(&told, "`away` set aside"), "{:#?}", told.notes);
}

#[test]
fn conflict_within_one_goal_is_named_when_idle() {
    let told = run(
        &task_with_rooms("(and (at lab) (not (at home)) (at ward))"),
        20,
        Vec::<(i64, _)>::new(),
    );
    assert_has(
        &told,
        &["rest: unsolvable-from-here problem: `(at lab)` and `(at ward)` exclude each other"],
    );
}

#[test]
fn each_goal_without_plan_has_its_own_reasons_when_idle() {
    let script = vec![
        (0, pursue("two", "(and (at home) (at ward))")),
        (0, pursue_by("late", "(at ward)", 5)),
    ];
    let told = run(&task_with_rooms("(and (at lab) (at ward))"), 4, script);
    assert_has(
        &told,
        &[
            "`problem` impossible: `(at lab)` and `(at ward)` exclude each other",
            "`two` impossible: `(at home)` and `(at ward)` exclude each other",
            "`late` impossible: `late` would be reached 5.001 s late: it cannot be reached before 10.001",
        ],
    );
}

#[test]
fn conflict_within_one_goal_is_the_reason_for_setting_it_aside() {
    let script = vec![(0, pursue("both", "(and (at home) (at lab))"))];
    let told = run(&task_with_rooms("(at ward)"), 100, script);
    assert_has(
        &told,
        &["`both` set aside, because `(at home)` and `(at lab)` exclude each other"],
    );
}

#[test]
fn late_goal_is_set_aside_and_fails_at_its_deadline() {
    let script = vec![
        (0, pursue_by("ward", "(at ward)", 5)),
        (0, pursue("lab", "(at lab)")),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(
        &told,
        &[
            "start (move home lab)",
            "5: `ward` failed, because its deadline has passed",
            "rest: goal-reached lab",
        ],
    );
}

#[test]
fn late_action_is_not_cancelled_if_only_one_of_the_goals_is_lost() {
    let domain = "(define (domain rooms)
      (:requirements :durative-actions :typing :timed-initial-literals)
      (:types room) (:predicates (at ?x - room) (day) (seen ?x - room))
      (:durative-action move :parameters (?x ?y - room) :duration (= ?duration 10)
        :condition (at start (at ?x)) :effect (and (at start (not (at ?x))) (at end (at ?y))))
      (:durative-action look :parameters (?x - room) :duration (= ?duration 1)
        :condition (and (at start (day)) (over all (at ?x))) :effect (at end (seen ?x))))";
    let problem = "(define (problem p) (:domain rooms) (:objects home lab ward - room)
       (:init (at home) (day) (at 12 (not (day)))) (:goal (and)))";
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(domain), &source(problem));
    let task = Arc::new(Task::new(read.expect("a correct test").0));
    let script = vec![
        (0, pursue("ward", "(seen ward)")),
        (0, pursue("lab", "(at lab)")),
    ];
    let slow = ("(move home ward)", Rational::from(18));
    let told = run_with_slow_action(&task, 100, script, slow);
    assert_has(
        &told,
        &[
            "start (move home ward)",
            "`ward` set aside",
            "18: start (move ward lab)",
            "28: rest",
        ],
    );
    assert!(!has(&told, "cancel"), "{:#?}", told.notes);
}

#[test]
fn goal_that_is_proven_late_is_not_tried_again() {
    let script = vec![
        (0, pursue_by("late", "(at ward)", 5)),
        (0, pursue_by("lab", "(at lab)", 15)),
        (0, pursue_by("ward", "(at ward)", 25)),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    let expected = [
        "0: `late` set aside, because no plan reaches it by its deadline",
        "10: `lab` achieved",
        "20: `ward` achieved",
    ];
    assert_has(&told, &expected);
    // One for all goals, and one for the others.
    let searches = told.notes.iter().filter(|it| it.starts_with("0: plan"));
    assert_eq!(searches.count(), 2, "{:#?}", told.notes);
}

#[test]
fn deadline_of_a_goal_that_is_set_aside_does_not_disturb_the_plan() {
    let script = vec![
        (0, pursue_by("late", "(at ward)", 5)),
        (0, pursue_by("lab", "(at lab)", 15)),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    let expected = [
        "0: `late` set aside",
        "5: `late` failed",
        "10: `lab` achieved",
    ];
    assert_has(&told, &expected);
    assert!(
        !has(&told, "5: plan") && !has(&told, "5: the plan is kept"),
        "{:#?}",
        told.notes
    );
}

#[test]
fn a_goal_without_others_fails_at_its_deadline() {
    let script = vec![
        (0, pursue_by("ward", "(at ward)", 5)),
        (20, pursue("lab", "(at lab)")),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(
        &told,
        &[
            "rest: unsolvable-from-here ward",
            "5: `ward` failed, because its deadline has passed",
            "start (move home lab)",
            "rest: goal-reached lab",
        ],
    );
}

#[test]
fn a_deadline_that_is_added_to_a_running_plan_is_met() {
    let script = vec![
        (0, pursue("lab", "(at lab)")),
        (5, pursue_by("ward", "(at ward)", 25)),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(
        &told,
        &[
            "`lab` achieved",
            "start (move lab ward)",
            "20: `ward` achieved",
            "rest: no goals",
        ],
    );
}

/// Returns a task with a room that timed initials open and close.
fn with_opening_hours(timed: &str) -> Arc<Task> {
    let domain = "(define (domain hours) (:requirements :durative-actions)
      (:predicates (open) (idle) (done))
      (:durative-action work :parameters () :duration (= ?duration 10)
        :condition (at start (idle)) :effect (at end (done))))";
    let problem =
        format!("(define (problem p) (:domain hours) (:init (idle) {timed}) (:goal (and)))");
    let source = |text: &str| Source::new("test", text);
    let read = pddl::read_problem(&source(domain), &source(&problem));
    Arc::new(Task::new(read.expect("a correct test").0))
}

#[test]
fn a_goal_that_timed_initials_achieve_for_a_moment_is_closed_then() {
    let task = with_opening_hours("(at 6 (open)) (at 9 (not (open))) (at 20 (open))");
    let told = run(&task, 100, vec![(0, pursue_by("open", "(open)", 12))]);
    assert_has(&told, &["6: `open` achieved"]);
}

#[test]
fn a_goal_that_timed_initials_achieve_too_late_has_failed() {
    let task = with_opening_hours("(at 12 (open))");
    let told = run(&task, 100, vec![(0, pursue_by("open", "(open)", 11))]);
    assert_has(&told, &["11: `open` failed"]);
    assert!(!has(&told, "achieved"), "{:#?}", told.notes);
}

#[test]
fn a_goal_without_deadline_is_still_confirmed_beside_one_with_a_deadline() {
    let script = vec![
        (0, pursue("lab", "(at lab)")),
        (0, pursue_by("same", "(at lab)", 50)),
    ];
    let told = run(&task_with_rooms("(and)"), 100, script);
    assert_has(&told, &["10: `same` achieved", "rest: goal-reached lab"]);
}
