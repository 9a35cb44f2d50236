//! Mid-execution starts, determinism, limits.

use std::ops::ControlFlow;

use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::{Interval, Rational};
use elbowroom_planner::{Answer, Settings, Stopped, plan};

use crate::world::{answer_from, describe, task};

const DELIVERY: &str = "
    (:requirements :typing :durative-actions :timed-initial-literals)
    (:predicates (here) (there) (loaded) (open) (delivered))
    (:durative-action go :parameters () :duration (= ?duration 10)
      :condition (at start (here)) :effect (and (at start (not (here))) (at end (there))))
    (:durative-action drop :parameters () :duration (= ?duration 2)
      :condition (and (over all (there)) (over all (open)) (at start (loaded)))
      :effect (and (at start (not (loaded))) (at end (delivered))))";

/// On the way since 0 with the parcel; it is 6 now.
fn on_the_way(closing: &str, duration: Interval) -> (Task, Situation) {
    let problem =
        format!("(:init (here) (loaded) (open) (at {closing} (not (open)))) (:goal (delivered))");
    let mut task = task(DELIVERY, &problem);
    let go = task.problem().schema("go").expect("as written above");
    let action = task.instantiate(go, &[]).expect("as written above");
    let mut situation = Situation::initial(&task);
    let here = task.problem().predicate("here").expect("as written above");
    let here = task.find_fact(here, &[]).expect("as written above");
    situation.state.facts.remove(&here);
    situation.time = 6.into();
    situation.running.push(RunningAction {
        action,
        start: Rational::ZERO,
        duration,
    });
    (task, situation)
}

#[test]
fn the_effect_of_what_is_under_way_is_used() {
    let (mut task, situation) = on_the_way("20", Interval::closed(8.into(), 15.into()));
    let answer = answer_from(&mut task, &situation, 100);
    assert_eq!(describe(&answer), "0: (go) [8]\n8: (drop) [2]");
}

#[test]
fn what_is_under_way_cannot_have_ended_before_now() {
    let (mut task, situation) = on_the_way("20", Interval::closed(2.into(), 15.into()));
    let answer = answer_from(&mut task, &situation, 100);
    assert_eq!(describe(&answer), "0: (go) [6]\n6: (drop) [2]");
}

#[test]
fn a_deadline_after_now_can_be_out_of_reach() {
    let (mut task, situation) = on_the_way("11.9", Interval::closed(10.into(), 15.into()));
    let answer = answer_from(&mut task, &situation, 100);
    assert_eq!(
        describe(&answer),
        "no plan exists: `(delivered)` cannot be reached before `(open)` closes at 11.9"
    );
}

#[test]
fn a_deadline_that_has_passed_does_not_come_again() {
    let (mut task, mut situation) = on_the_way("5", Interval::closed(8.into(), 15.into()));
    let open = task.problem().predicate("open").expect("as written above");
    let open = task.find_fact(open, &[]).expect("as written above");
    situation.state.facts.remove(&open);
    let answer = answer_from(&mut task, &situation, 100);
    assert!(matches!(answer, Answer::Unsolvable { .. }));
}

const GRID: &str = "
    (:requirements :typing :durative-actions :numeric-fluents)
    (:types place) (:predicates (at ?p - place) (next ?a ?b - place) (been ?p - place))
    (:functions (steps))
    (:durative-action go :parameters (?a ?b - place) :duration (= ?duration 1)
      :condition (and (at start (at ?a)) (at start (next ?a ?b)))
      :effect (and (at start (not (at ?a))) (at end (at ?b)) (at end (been ?b))
                   (at end (increase (steps) 1))))";

/// A ring in which the goal asks for more steps than anyone would wait for.
fn endless() -> Task {
    task(
        GRID,
        "(:objects a b c - place) (:init (at a) (next a b) (next b c) (next c a) (next b a)
         (= (steps) 0)) (:goal (and (been c) (at a) (>= (steps) 100000)))",
    )
}

#[test]
fn a_search_ends_when_it_is_told_to() {
    let mut task = endless();
    let situation = Situation::initial(&task);
    let answer = answer_from(&mut task, &situation, 5);
    assert_eq!(describe(&answer), "none found: Interrupted");
}

#[test]
fn a_search_ends_when_its_memory_is_used_up() {
    let mut task = endless();
    let situation = Situation::initial(&task);
    let settings = Settings {
        max_memory: 1 << 20,
        ..Settings::default()
    };
    let mut most = 0;
    let answer = plan(&mut task, &situation, &settings, &mut |progress| {
        most = most.max(progress.counts.memory);
        ControlFlow::Continue(())
    });
    let Answer::NoneFound { stopped, .. } = answer else {
        panic!("{}", describe(&answer));
    };
    assert_eq!(stopped, Stopped::OutOfMemory);
    assert!(most < 4 << 20, "{most}");
}

#[test]
fn the_same_problem_has_the_same_answer_and_reports() {
    let run = || {
        let mut task = task(
            GRID,
            "(:objects a b c - place) (:init (at a) (next a b) (next b c) (next c a) (next b a)
             (= (steps) 0)) (:goal (and (been c) (at a) (>= (steps) 5)))",
        );
        let situation = Situation::initial(&task);
        let mut reports = Vec::new();
        let answer = plan(
            &mut task,
            &situation,
            &Settings::default(),
            &mut |progress| {
                reports.push(format!("{progress:?}"));
                if reports.len() > 30 {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            },
        );
        (describe(&answer), reports)
    };
    assert_eq!(run(), run());
}
