//! Numbers that change continuously, and conditions on them.

use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings as Strictness, validate};
use elbowroom_model::{Situation, Task};
use elbowroom_planner::{Answer, Settings, plan};

use crate::embedded::world::{describe, task};

/// Maximum number of states per problem.
const STATES: u64 = 200;

fn answered(task: &Task) -> Answer {
    let settings = Settings {
        first_plan_only: true,
        ..Settings::default()
    };
    plan(
        task,
        &Situation::initial(task),
        &settings,
        &mut |progress| {
            if progress.counts.evaluated < STATES {
                ControlFlow::Continue(())
            } else {
                ControlFlow::Break(())
            }
        },
    )
}

/// Returns the names of the steps of the first plan in the order of their starts, without
/// repetition.
fn found(domain: &str, problem: &str) -> Vec<String> {
    let task = task(domain, problem);
    let answer = answered(&task);
    let Some(found) = answer.found() else {
        panic!("{}", describe(&answer));
    };
    let verdict = validate(&task, &found.plan, &Strictness::default());
    assert!(verdict.is_valid(), "{}", describe(&answer));
    let steps = found.plan.steps.iter();
    let mut names: Vec<String> = steps.map(|step| step.action.name.clone()).collect();
    names.dedup();
    names
}

const BATH: &str = "
    (:requirements :adl :durative-actions :numeric-fluents :continuous-effects
                   :timed-initial-literals :timed-initial-fluents :duration-inequalities)
    (:predicates (warm) (rung) (done) (spilt) (open))
    (:functions (level) (load))
    (:durative-action fill :parameters () :duration (= ?duration 10)
      :condition (and) :effect (increase (level) (* #t 2)))";

#[test]
fn start_effect_under_condition_on_moving_number_takes_place_late_enough() {
    let domain = format!(
        "{BATH}
        (:durative-action ring :parameters () :duration (= ?duration 1)
          :condition (and)
          :effect (when (at start (and (>= (level) 5) (<= (level) 6))) (at start (rung))))"
    );
    let names = found(&domain, "(:init (= (level) 0)) (:goal (rung))");
    assert_eq!(names, ["(fill)", "(ring)"]);
}

#[test]
fn end_effect_under_condition_on_moving_number_is_avoided() {
    let domain = format!(
        "{BATH}
        (:durative-action wash :parameters () :duration (= ?duration 3)
          :condition (over all (>= (level) 1))
          :effect (and (at end (done)) (when (at end (> (level) 12)) (at end (spilt)))))"
    );
    let problem = "(:init (= (level) 0)) (:goal (and (done) (not (spilt))))";
    assert_eq!(found(&domain, problem), ["(fill)", "(wash)"]);
}

#[test]
fn total_of_continuous_change_with_fixed_duration_is_known() {
    let domain = format!(
        "{BATH}
        (:durative-action ring :parameters () :duration (= ?duration 1)
          :condition (and)
          :effect (when (at start (= (level) 40)) (at start (rung))))"
    );
    let names = found(&domain, "(:init (= (level) 0)) (:goal (rung))");
    assert_eq!(names, ["(fill)", "(ring)"]);
}

#[test]
fn later_alternative_of_over_all_disjunction_holds() {
    let domain = format!(
        "{BATH}
        (:durative-action wash :parameters () :duration (= ?duration 2)
          :condition (over all (or (< (level) 1) (> (level) 9)))
          :effect (at end (done)))"
    );
    let problem = "(:init (= (level) 1) (at 0.001 (open))) (:goal (and (open) (done)))";
    assert_eq!(found(&domain, problem), ["(fill)", "(wash)"]);
}

/// The number lies on either side of 5 at the ends of a wash that starts too early.
#[test]
fn disequality_holds_throughout_and_not_only_at_the_ends() {
    let domain = format!(
        "{BATH}
        (:durative-action wash :parameters () :duration (= ?duration 4)
          :condition (and (at start (>= (level) 2)) (over all (not (= (level) 5))))
          :effect (at end (done)))"
    );
    let names = found(&domain, "(:init (= (level) 0)) (:goal (done))");
    assert_eq!(names, ["(fill)", "(wash)"]);
}

#[test]
fn disequality_is_left_at_the_start() {
    let domain = format!(
        "{BATH}
        (:durative-action rise :parameters () :duration (= ?duration 4)
          :condition (over all (not (= (level) 5)))
          :effect (and (increase (level) (* #t 1)) (at end (done))))"
    );
    let names = found(&domain, "(:init (= (level) 5)) (:goal (done))");
    assert_eq!(names, ["(rise)"]);
}

#[test]
fn later_alternative_of_goal_disjunction_is_reached() {
    let problem = "(:init (= (level) 0))
                   (:goal (or (and (> (level) 3) (< (level) 7)) (= (level) 40)))";
    assert_eq!(found(BATH, problem), ["(fill)"]);
}

#[test]
fn product_of_moving_number_with_chosen_duration_is_found() {
    let domain = "
        (:requirements :durative-actions :numeric-fluents :duration-inequalities)
        (:functions (load))
        (:durative-action grow :parameters ()
          :duration (and (>= ?duration 1) (<= ?duration 3))
          :condition (and)
          :effect (and (at start (increase (load) ?duration)) (at end (scale-up (load) (load)))))";
    let names = found(domain, "(:init (= (load) 1)) (:goal (= (load) 16))");
    assert_eq!(names, ["(grow)"]);
}

/// `double` is preferred in each state, and never leads to the goal.
#[test]
fn step_that_only_changes_a_number_is_not_repeated_for_ever() {
    let domain = "
        (:requirements :durative-actions :numeric-fluents)
        (:functions (load) (spare))
        (:durative-action double :parameters () :duration (= ?duration 1)
          :condition (and) :effect (at end (increase (load) (load))))
        (:durative-action add :parameters () :duration (= ?duration 1)
          :condition (and) :effect (at end (increase (load) (spare))))";
    let names = found(
        domain,
        "(:init (= (load) -1) (= (spare) 2)) (:goal (>= (load) 2))",
    );
    assert!(names.contains(&"(add)".to_owned()), "{names:?}");
}

#[test]
fn inexpressible_constraint_keeps_other_constraints_active() {
    let domain = format!(
        "{BATH}
        (:durative-action ring :parameters () :duration (= ?duration 1)
          :condition (and) :effect (at end (rung)))"
    );
    let problem = "(:init (= (level) 0)) (:goal (and))
        (:constraints (and (at-most-once (>= (level) 5)) (within 9 (rung))))";
    let names = found(&domain, problem);
    assert!(names.contains(&"(ring)".to_owned()), "{names:?}");
}

#[test]
fn moving_number_satisfies_hold_during() {
    let problem = "(:init (= (level) 0)) (:goal (and))
        (:constraints (hold-during 4 5 (>= (level) 6)))";
    assert_eq!(found(BATH, problem), ["(fill)"]);
}
