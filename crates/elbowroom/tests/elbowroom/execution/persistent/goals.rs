//! Goals that are added and removed during a run.

use elbowroom::execute::{Embedded, Execution, read_goal};
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{
    Ending, Event, Observation, PlanAnswer, Planner, PlannerAnswer, Request,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use std::sync::{Arc, PoisonError};

use super::scripted::{
    Notes, ScriptedWorld, abandon, assert_has, has, pursue, run, scripted, task,
};

#[test]
fn run_is_idle_after_reaching_its_goal() {
    let task = task("", "(have book)");
    let told = run(&task, 100, vec![(40, pursue("cup", "(have cup)"))]);
    assert_has(
        &told,
        &[
            "start (fetch r book)",
            "rest: goal-reached problem",
            "40: plan, because the goals have changed: `cup` is to be reached",
            "40: start (fetch r cup)",
            "rest: goal-reached cup",
        ],
    );
    assert_eq!(told.report.verdict, Verdict::Interrupted);
}

#[test]
fn run_without_goal_is_idle_until_one_is_given() {
    let task = task("", "(and)");
    let told = run(&task, 60, vec![(30, pursue("cup", "(have cup)"))]);
    assert_has(
        &told,
        &[
            "0: rest: no goals",
            "30: start (fetch r cup)",
            "rest: goal-reached cup",
        ],
    );
    assert_eq!(told.plans, 1);
}

#[test]
fn goal_reached_by_remaining_plan_needs_no_replan() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(
        &task,
        60,
        vec![(5, pursue("again", "(or (have cup) (have key))"))],
    );
    assert_has(
        &told,
        &["5: the plan is kept", "rest: goal-reached problem again"],
    );
    assert_eq!(
        (told.plans, told.report.starts),
        (1, 2),
        "{:#?}",
        told.notes
    );
}

#[test]
fn running_actions_continue_when_goals_change() {
    let task = task("", "(and (have book) (have cup))");
    for change in [pursue("key", "(have key)"), abandon("problem")] {
        let told = run(&task, 100, vec![(5, change)]);
        assert!(!has(&told, "cancel"), "{:#?}", told.notes);
        let first = &told.report.executed[0];
        assert_eq!(first.ending, Some(Ending::Succeeded));
        assert_eq!(first.step.duration, Some(Rational::from(10)));
    }
}

#[test]
fn abandoned_goal_starts_no_further_action() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 100, vec![(5, abandon("problem"))]);
    assert_has(&told, &["5: rest: no goals"]);
    assert_eq!(told.report.starts, 1);
}

#[test]
fn remaining_goals_are_pursued_after_abandonment() {
    let task = task("", "(have book)");
    let script = vec![
        (1, pursue("cup", "(have cup)")),
        (2, pursue("key", "(have key)")),
        (3, abandon("cup")),
    ];
    let told = run(&task, 100, script);
    assert_has(&told, &["start (fetch r key)", "rest: goal-reached key"]);
    assert!(!has(&told, "start (fetch r cup)"), "{:#?}", told.notes);
}

#[test]
fn goal_with_same_name_replaces_earlier_one() {
    let task = task("", "(and)");
    let script = vec![
        (1, pursue("it", "(have cup)")),
        (30, pursue("it", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert_has(
        &told,
        &[
            "rest: goal-reached it",
            "start (fetch r key)",
            "rest: goal-reached it",
        ],
    );
    let script = vec![
        (1, pursue("a", "(have book)")),
        (2, pursue("it", "(have cup)")),
        (3, pursue("it", "(have key)")),
    ];
    let told = run(&task, 100, script);
    assert!(!has(&told, "start (fetch r cup)"), "{:#?}", told.notes);
    assert_has(&told, &["start (fetch r key)", "rest: goal-reached it"]);
}

#[test]
fn non_persistent_run_rejects_requests() {
    let task = task("", "(have book)");
    let mut world = ScriptedWorld {
        now: Rational::ZERO,
        coming: vec![Observation {
            time: Rational::ONE,
            event: Event::Requested(Request::Pause),
        }],
        end: Rational::from(60),
        stop_requested: Arc::default(),
        slow: None,
        on_cancel: None,
    };
    let notes = Notes::default();
    let report = Execution::of(&task)
        .recorded_by(notes.clone())
        .run_in(&mut world);
    assert_eq!(report.verdict, Verdict::GoalReached);
    let notes = notes
        .0
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .clone();
    assert!(
        notes.iter().any(|it| it.contains("accepts no requests")),
        "{notes:?}"
    );
}

#[test]
fn goal_is_parsed_as_in_problem_and_errors_are_reported() {
    let task = task("", "(have book)");
    for goal in [
        "(have cup)",
        "(and (have cup) (not (here key)))",
        "(>= (charge) 3)",
    ] {
        assert!(read_goal(&task, goal).is_ok(), "{goal}");
    }
    let forall = "(forall (?x - item) (have ?x))";
    assert!(read_goal(&task, forall).is_ok());
    for (goal, why) in [
        ("", "an empty goal"),
        ("(have spoon)", "spoon"),
        ("(hav cup)", "did you mean `have`"),
        ("(have cup) (have key)", "a second condition"),
        ("(have cup", "without a matching"),
    ] {
        let told = read_goal(&task, goal).expect_err(goal);
        assert!(told.contains(why), "{goal}: {told}");
        assert!(!told.contains('\n'), "{told}");
    }
}

/// Planner that returns this answer until the power is back, and plans afterwards.
struct PowerDependentPlanner(PlanAnswer);

impl Planner for PowerDependentPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let answer = Embedded::default().plan(task, situation);
        let is_powered = situation.time >= Rational::from(30);
        PlannerAnswer {
            seconds: None,
            answer: if is_powered {
                answer.answer
            } else {
                self.0.clone()
            },
            ..answer
        }
    }
}

#[test]
fn timed_initial_ends_idling_unless_no_plan_exists() {
    let task = task("(at 1 (not (power))) (at 30 (power))", "(have book)");
    let not_found = PlanAnswer::NotFound {
        why: "the budget is used up".to_owned(),
    };
    for (answer, is_reached) in [(not_found, true), (PlanAnswer::Unsolvable, false)] {
        let script: Vec<(i64, Event)> = Vec::new();
        let planner = PowerDependentPlanner(answer.clone());
        let told = scripted(&task, 100, script, |execution| {
            execution.with_planner(planner).persistent(true)
        });
        let reached = has(&told, "rest: goal-reached problem");
        assert_eq!(reached, is_reached, "{answer:?}: {:#?}", told.notes);
        let is_started = has(&told, "start (fetch r book)");
        assert_eq!(is_started, is_reached, "{answer:?}: {:#?}", told.notes);
    }
}
