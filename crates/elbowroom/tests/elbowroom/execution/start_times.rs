//! Start times that `live` chooses so that a plan tolerates more.

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::num::Rational;

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
