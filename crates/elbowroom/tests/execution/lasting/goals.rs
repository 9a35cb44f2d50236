//! Goals that are added and removed during a run.

use elbowroom::execute::{Embedded, Execution, read_goal};
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{
    Ending, Event, Observation, PlanAnswer, Planner, PlannerAnswer, Request,
};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use std::sync::{Arc, PoisonError};

use super::scripted::{Notes, Scripted, abandon, assert_has, has, pursue, run, scripted, task};

#[test]
fn a_goal_is_reached_and_the_run_waits_for_the_next_one() {
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
fn without_a_goal_nothing_is_done_until_one_is_given() {
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
fn a_goal_that_the_rest_of_the_plan_reaches_too_costs_no_new_plan() {
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
fn what_is_running_goes_on_when_a_goal_comes_or_goes() {
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
fn of_an_abandoned_goal_nothing_more_is_started() {
    let task = task("", "(and (have book) (have cup))");
    let told = run(&task, 100, vec![(5, abandon("problem"))]);
    assert_has(&told, &["5: rest: no goals"]);
    assert_eq!(told.report.starts, 1);
}

#[test]
fn of_several_goals_the_others_are_pursued_when_one_is_abandoned() {
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
fn a_goal_of_the_same_name_takes_the_place_of_the_earlier_one() {
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
fn a_run_that_ends_with_its_goal_takes_no_requests() {
    let task = task("", "(have book)");
    let mut world = Scripted {
        now: Rational::ZERO,
        coming: vec![Observation {
            time: Rational::ONE,
            event: Event::Asked(Request::Pause),
        }],
        end: Rational::from(60),
        is_to_end: Arc::default(),
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
        notes.iter().any(|it| it.contains("takes no requests")),
        "{notes:?}"
    );
}

#[test]
fn a_goal_is_read_as_in_a_problem_and_mistakes_are_named() {
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
struct Powered(PlanAnswer);

impl Planner for Powered {
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
fn timed_initial_ends_a_rest_unless_no_plan_exists() {
    let task = task("(at 1 (not (power))) (at 30 (power))", "(have book)");
    let not_found = PlanAnswer::NotFound {
        why: "the budget is used up".to_owned(),
    };
    for (answer, is_reached) in [(not_found, true), (PlanAnswer::Unsolvable, false)] {
        let script: Vec<(i64, Event)> = Vec::new();
        let planner = Powered(answer.clone());
        let told = scripted(&task, 100, script, |execution| {
            execution.planned_by(planner).lasting(true)
        });
        let reached = has(&told, "rest: goal-reached problem");
        assert_eq!(reached, is_reached, "{answer:?}: {:#?}", told.notes);
        let is_started = has(&told, "start (fetch r book)");
        assert_eq!(is_started, is_reached, "{answer:?}: {:#?}", told.notes);
    }
}
