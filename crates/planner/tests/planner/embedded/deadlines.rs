//! Compares deadlines of goals in mid-execution with the same problem from its beginning with
//! `within`.

use std::sync::Arc;

use elbowroom_model::problem::Constraint;
use elbowroom_model::validate::{Settings, validate, validate_from};
use elbowroom_model::{Modal, RunningAction, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::{Interval, Rational};
use elbowroom_planner::Answer;

use crate::embedded::trajectory_reference::{CONDITIONS, Rng, domain};
use crate::embedded::world::{answer_from, describe, task};

/// Times before the situation.
const BEFORE: i64 = 3;

/// Returns a random problem with one constraint `within`, and the same with a deadline that is later by [`BEFORE`]
/// instead.
fn problems(dice: &mut Rng) -> (Task, Task, String) {
    let domain = domain(dice);
    let initial = dice.one(&["", "(p)", "(q)", "(p) (r)", "(q) (r)"]);
    let (number, time) = (dice.below(3), dice.below(7));
    let condition = dice.one(&CONDITIONS);
    let with = |constraint: &str| {
        let begin = format!("(:init {initial} (= (x) {number}))");
        task(&domain, &format!("{begin} (:goal (g)) {constraint}"))
    };
    let within = format!("(:constraints (within {time}.5 {condition}))");
    let (from_beginning, plain) = (with(&within), with(""));
    let deadline = match &from_beginning.problem().constraints[0] {
        Constraint::Modal(Modal::Within(time, condition)) => {
            (time + Rational::from(BEFORE), condition.clone())
        }
        other => panic!("{other:?}"),
    };
    let later = plain.with_deadlines([(deadline.0, &deadline.1)]);
    let later = later.expect("no constraints of its own");
    (
        from_beginning,
        later,
        format!("{domain}\n{initial} {number}\n{within}"),
    )
}

/// Returns the plan as one of `task`, with all starts shifted later by [`BEFORE`], or earlier.
fn moved(task: &Task, plan: &TimeTriggeredPlan, is_later: bool) -> TimeTriggeredPlan {
    let by = Rational::from(if is_later { BEFORE } else { -BEFORE });
    let steps = plan.steps.iter().map(|step| Step {
        start: &step.start + &by,
        // Facts have other numbers in another task.
        action: Arc::new(task.instantiate(step.action.schema, &[]).unwrap()),
        duration: step.duration.clone(),
    });
    TimeTriggeredPlan {
        steps: steps.collect(),
    }
}

#[test]
fn mid_execution_deadline_equals_deadline_of_shifted_problem() {
    let mut dice = Rng(0x1357_9bdf_2468_ace1);
    let (mut found, mut none) = (0, 0);
    for _ in 0..150 {
        let (beginning, later, text) = problems(&mut dice);
        let situation = Situation {
            time: Rational::from(BEFORE),
            ..Situation::initial(&later)
        };
        let settings = Settings::default();
        let first = answer_from(&beginning, &Situation::initial(&beginning), 150);
        let second = answer_from(&later, &situation, 150);
        if let Some(plan) = second.found() {
            let verdict = validate_from(&later, &situation, &plan.plan, &settings);
            assert!(verdict.is_valid(), "{text}\n{verdict:?}");
            let verdict = validate(&beginning, &moved(&beginning, &plan.plan, false), &settings);
            assert!(verdict.is_valid(), "{text}\n{verdict:?}");
        }
        if let Some(plan) = first.found() {
            let verdict = validate_from(
                &later,
                &situation,
                &moved(&later, &plan.plan, true),
                &settings,
            );
            assert!(verdict.is_valid(), "{text}\n{verdict:?}");
        }
        let is_same = first.found().is_some() == second.found().is_some();
        assert!(
            is_same,
            "{text}\n{}\n{}",
            describe(&first),
            describe(&second)
        );
        match second {
            Answer::Plan { .. } => found += 1,
            _ => none += 1,
        }
    }
    assert!(
        found > 30 && none > 15,
        "{found} found, {none} without a plan"
    );
}

#[test]
fn running_actions_end_as_planned_under_deadlines() {
    let mut dice = Rng(0x0fed_cba9_8765_4321);
    let (mut found, mut missed) = (0, 0);
    for _ in 0..150 {
        let (_, task, text) = problems(&mut dice);
        let action = Arc::new(task.instantiate(0.into(), &[]).unwrap());
        let Some(body) = action.durative() else {
            continue;
        };
        let duration = body.duration[0].bound.evaluate(&mut |_| None).unwrap();
        let start = Rational::from(BEFORE) - Rational::new(1, 2);
        let mut situation = Situation {
            time: Rational::from(BEFORE),
            ..Situation::initial(&task)
        };
        situation.running.push(RunningAction {
            action: Arc::clone(&action),
            start: start.clone(),
            duration: Interval::point(duration.clone()),
        });
        let answer = answer_from(&task, &situation, 150);
        let settings = Settings::default();
        if let Some(plan) = answer.found() {
            let verdict = validate_from(&task, &situation, &plan.plan, &settings);
            assert!(verdict.is_valid(), "{text}\n{verdict:?}");
            found += 1;
            continue;
        }
        // The running action alone achieves the goal.
        let alone = TimeTriggeredPlan {
            steps: vec![situation.running[0].step(duration)],
        };
        let verdict = validate_from(&task, &situation, &alone, &settings);
        assert!(!verdict.is_valid(), "{text}\n{}", describe(&answer));
        missed += 1;
    }
    assert!(
        found > 20 && missed > 15,
        "{found} found, {missed} without a plan"
    );
}
