//! Plans whose numbers are beyond exact analysis: the validator checks the remaining plan at its
//! planned values.

use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeRequest, envelope};
use elbowroom::execute::PlanPreparer;
use elbowroom::execution::NoRecord;
use elbowroom::execution::run::{Report, Verdict};
use elbowroom::sim::SimWorld;

use crate::execution::scene::Scene;

/// The water flows in faster if the head is higher, which sinks meanwhile.
const DOMAIN: &str = "(define (domain pond)
    (:requirements :durative-actions :numeric-fluents :continuous-effects :negative-preconditions)
    (:predicates (idle) (inspected) (open))
    (:functions (head) (water))
    (:durative-action drain :parameters () :duration (= ?duration 4)
      :condition (at start (idle))
      :effect (and (at start (not (idle))) (at end (idle)) (decrease (head) (* #t 1))
        (increase (water) (* #t (* 2 (head)))) (at end (open))))
    (:durative-action inspect :parameters () :duration (= ?duration 3)
      :condition (and (at start (open)) (at start (idle)))
      :effect (and (at start (not (idle))) (at end (idle)) (at end (inspected)))))";
const PLAN: &str = "0: (drain) [4]\n4.001: (inspect) [3]\n";

/// Runs the plan with this duration of draining and this goal for the water.
fn run(takes: &str, water: u32) -> (Scene, Report) {
    let problem = format!(
        "(define (problem p) (:domain pond) (:init (idle) (= (head) 10) (= (water) 0))
           (:goal (and (inspected) (>= (water) {water}))))"
    );
    let scene = Scene::new(DOMAIN, &problem, Some(PLAN));
    let world = format!("[[duration]]\naction = \"drain\"\nconstant = {takes}\n");
    let model = scene.world(&world);
    let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 0);
    let mut analyst = PlanPreparer::new(scene.flow.clone());
    let report = scene.run_in("live", &mut world, &mut analyst, &mut NoRecord);
    (scene, report)
}

#[test]
fn deviation_within_remaining_plan_needs_no_replan() {
    // 2 (10 t - t²/2): 57.75 after 3.5, 64 after 4, 69.75 after 4.5.
    for (takes, water) in [("3.5", 57), ("4.5", 64), ("3.999", 60)] {
        let (scene, report) = run(takes, water);
        assert_eq!(report.verdict, Verdict::GoalReached, "{takes}");
        assert_eq!(report.replans, 0, "{takes}: {:?}", report.reasons);
        let request = EnvelopeRequest::new(&scene.task, scene.plan.clone());
        let refused = envelope(&request, &mut NoObserver);
        assert!(refused.is_err(), "else the test is about nothing");
    }
}

#[test]
fn infeasible_remaining_plan_is_abandoned_at_once() {
    let (_, report) = run("3.5", 60);
    let reason = report.reasons.first().expect("the plan is abandoned");
    let since = reason.since.as_ref().expect("at a time");
    assert_eq!(since.to_string(), "7/2");
    assert!(reason.to_string().contains("(water)"), "{reason}");
}
