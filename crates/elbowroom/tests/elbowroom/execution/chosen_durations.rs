//! Durations that the executor chooses: they are fixed at the start of the action, and cannot be
//! changed later.

use elbowroom::execution::run::Verdict;
use elbowroom::num::{End, Rational};

use crate::execution::scene::Scene;

/// A heater that can be set to at most an hour, and has to run until the glue is dry.
const GLUING: &str = "(define (domain gluing)
    (:requirements :durative-actions :duration-inequalities)
    (:predicates (off) (warm) (glued))
    (:durative-action heat :parameters ()
      :duration (and (>= ?duration 1) (<= ?duration 60))
      :condition (at start (off))
      :effect (and (at start (not (off))) (at start (warm)) (at end (not (warm)))))
    (:durative-action glue :parameters () :duration (= ?duration 10)
      :condition (over all (warm)) :effect (at end (glued))))";

const PROBLEM: &str = "(define (problem p) (:domain gluing) (:init (off)) (:goal (glued)))";

/// If the heater could be switched off when the glue is dry, gluing could take an hour. It cannot,
/// because it was set to 14 when it was switched on.
#[test]
fn guarantee_does_not_depend_on_duration_chosen_later() {
    let plan = "0: (heat) [14]\n0.001: (glue) [10]";
    for specs in [
        &["duration (glue)"][..],
        &["durations", "controllable heat"],
    ] {
        let mut scene = Scene::new(GLUING, PROBLEM, Some(plan));
        scene.flow.vary = specs
            .iter()
            .map(|spec| spec.parse().expect("a correct test"))
            .collect();
        let prepared = scene.prepared("guarded");
        let envelope = prepared.envelope.expect("a dynamic box");
        let [interval] = envelope.intervals() else {
            panic!("one duration is open: {envelope:?}");
        };
        let End::Closed(most) = interval.upper.clone() else {
            panic!("{interval:?}");
        };
        assert!(most > Rational::from(12), "{most}");
        assert!(most <= Rational::from(14), "{most}");
        for takes in [Rational::from(1), Rational::from(13), most.clone()] {
            let seconds = takes.to_decimal(9);
            let world = format!("[[duration]]\naction = \"glue\"\nconstant = {seconds}\n");
            let world = scene.world(&world);
            for executor in ["guarded", "live"] {
                let report = scene.run(executor, &world, 0);
                assert_eq!(report.verdict, Verdict::GoalReached, "{executor}, {takes}");
                assert_eq!(
                    report.replans, 0,
                    "{executor}, {takes}: {:?}",
                    report.reasons
                );
                assert!(scene.judged(&report).is_valid(), "{executor}, {takes}");
            }
        }
    }
}
