//! Start times that `live` chooses so that a plan tolerates more.

use std::sync::Arc;

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::execution::{Ending, NoPlanner};
use elbowroom::num::Rational;
use elbowroom::pipeline;
use elbowroom::sim::SimWorld;

use crate::execution::scene::Scene;

/// An oven that has to stay hot while dough bakes, and to be cool at the end.
const OVEN: &str = "(define (domain oven)
    (:requirements :durative-actions :numeric-fluents :continuous-effects :timed-initial-literals)
    (:predicates (dough) (bread) (day)) (:functions (heat))
    (:durative-action cool :parameters () :duration (= ?duration 60)
      :condition (and (over all (>= (heat) 0)) (over all (day))) :effect (decrease (heat) (* #t 2)))
    (:durative-action bake :parameters () :duration (= ?duration 20)
      :condition (and (at start (dough)) (over all (>= (heat) 180)))
      :effect (and (at start (not (dough))) (at end (bread)))))";

const WARM: &str = "(define (problem p) (:domain oven) (:init (dough) (day) (= (heat) 186))
    (:goal (and (bread) (<= (heat) 70))))";

/// The plan cools as early as possible: 3 s before the planned end of baking.
const EARLY_COOLING: &str = "0: (bake) [20]\n17: (cool) [60]";

/// A weld has to begin before the clamp is closed, and to end after that. A failed weld can be
/// repeated; a failed clamp loses the part.
const CLAMP: &str = "(define (domain clamp) (:requirements :durative-actions)
    (:predicates (loose) (held) (warm) (fixed) (done))
    (:durative-action clamp :parameters () :duration (= ?duration 10)
      :condition (and (at start (loose)) (at end (warm)))
      :effect (and (at start (not (loose))) (at start (held)) (at end (fixed))))
    (:durative-action weld :parameters () :duration (= ?duration 3)
      :condition (and (at start (held)) (at end (fixed)))
      :effect (and (at start (warm)) (at end (done)))))";

const PART: &str = "(define (problem p) (:domain clamp) (:init (loose)) (:goal (done)))";

const CLAMPED_WELD: &str = "0: (clamp) [10]\n8.5: (weld) [3]";

fn duration(action: &str, share: &str) -> String {
    format!("[[duration]]\naction = \"{action}\"\nconstant = {share}\nrelative = true\n")
}

fn start_of(report: &Report, action: &str) -> Rational {
    let mut steps = report.executed.iter();
    let executed = steps.find(|it| it.step.action.name == action);
    executed.expect("the action is executed").step.start.clone()
}

#[test]
fn cooling_starts_when_action_that_needs_heat_has_ended() {
    let scene = Scene::new(OVEN, WARM, Some(EARLY_COOLING));
    for share in ["0.7", "1", "1.3"] {
        let world = scene.world(&duration("bake", share));
        let report = scene.run("live", &world, 0);
        assert_eq!(report.verdict, Verdict::GoalReached, "{share}");
        assert_eq!(report.replans, 0, "{share}: {:?}", report.reasons);
        let baked = share.parse::<Rational>().expect("a number") * Rational::from(20);
        assert!(start_of(&report, "(cool)") >= baked, "{share}");
    }
}

#[test]
fn cooling_starts_as_planned_if_it_cannot_wait() {
    let until = WARM.replace("(:init", "(:init (at 78 (not (day)))");
    let scene = Scene::new(OVEN, &until, Some(EARLY_COOLING));
    let report = scene.run("live", &scene.world(""), 0);
    assert_eq!(report.verdict, Verdict::GoalReached);
    assert!(start_of(&report, "(cool)") < Rational::from(20));
}

#[test]
fn action_that_can_be_repeated_starts_early_if_both_sides_are_narrow() {
    let scene = Scene::new(CLAMP, PART, Some(CLAMPED_WELD));
    for share in ["0.7", "1", "1.3"] {
        let world = scene.world(&duration("clamp", share));
        let report = scene.run("live", &world, 0);
        assert_eq!(report.verdict, Verdict::GoalReached, "{share}");
        let mut executed = report.executed.iter();
        let clamp = executed.find(|it| it.step.action.name == "(clamp)");
        let clamp = clamp.expect("the part is clamped");
        assert_eq!(clamp.ending, Some(Ending::Succeeded), "{share}");
    }
}

#[test]
fn action_that_can_be_repeated_starts_as_planned_without_a_planner() {
    let mut scene = Scene::new(CLAMP, PART, Some(CLAMPED_WELD));
    scene.flow = pipeline::Settings::default();
    for share in ["0.95", "1", "1.05"] {
        let world = scene.world(&duration("clamp", share));
        let mut world = SimWorld::new(Arc::clone(&scene.task), &world, 0);
        let execution = scene.execution("live").with_planner(NoPlanner);
        let report = execution.run_in(&mut world);
        assert_eq!(report.verdict, Verdict::GoalReached, "{share}");
    }
}
