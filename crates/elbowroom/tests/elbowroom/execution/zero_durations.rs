//! Actions of duration 0: their over-all conditions are vacuous, and they start and end at one
//! moment.

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeRequest, envelope};
use elbowroom::execution::run::Verdict;
use elbowroom::sim::WorldModel;

use crate::execution::scene::Scene;

/// Executors that follow any valid plan without deviations.
const EXECUTORS: [&str; 4] = ["guarded", "live", "stn", "fixed:1000"];

fn scene(actions: &str, init: &str, goal: &str, plan: &str) -> Scene {
    let domain = format!(
        "(define (domain d) (:requirements :durative-actions)
          (:predicates (p) (q) (r)) {actions})"
    );
    let problem = format!("(define (problem x) (:domain d) (:init {init}) (:goal (and {goal})))");
    let mut scene = Scene::new(&domain, &problem, Some(plan));
    scene.settings.max_replans = 0;
    scene
}

/// Checks that the plan has an envelope, and that the runs under it reach the goal and are valid.
fn assert_works(scene: &Scene) {
    let request = EnvelopeRequest::new(&scene.task, scene.plan.clone());
    let outcome = envelope(&request, &mut NoObserver).expect("within exact analysis");
    assert!(outcome.envelope.is_some(), "{:#?}", outcome.answer.finding);
    for executor in EXECUTORS {
        let report = scene.run(executor, &WorldModel::without_deviations(), 0);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        assert!(scene.judged(&report).is_valid(), "{executor}: {report:#?}");
    }
}

#[test]
fn over_all_condition_of_zero_duration_is_vacuous() {
    let action = "(:durative-action a :parameters () :duration (= ?duration 0)
        :condition (over all (p)) :effect (at end (p)))";
    assert_works(&scene(action, "", "(p)", "0: (a) [0]"));
}

#[test]
fn zero_duration_action_works_between_others() {
    let actions = "(:durative-action a :parameters () :duration (= ?duration 2)
        :condition (at start (p)) :effect (at end (q)))
      (:durative-action b :parameters () :duration (= ?duration 0)
        :condition (and (at start (q)) (over all (not (q)))) :effect (at end (r)))";
    let plan = "0: (a) [2]\n2.001: (b) [0]";
    assert_works(&scene(actions, "(p)", "(q) (r)", plan));
}

#[test]
fn zero_duration_chosen_by_planner_works() {
    let action = "(:durative-action a :parameters ()
        :duration (and (>= ?duration 0) (<= ?duration 5))
        :condition (over all (p)) :effect (at end (q)))";
    assert_works(&scene(action, "", "(q)", "0: (a) [0]"));
}
