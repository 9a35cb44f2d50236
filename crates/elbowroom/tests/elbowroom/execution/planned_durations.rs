//! `?duration` is the planned duration until an action ends, for envelopes, the simulator,
//! executors and the validator of executed plans.

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeRequest, envelope};
use elbowroom::execution::run::{TimeoutRule, Verdict};
use elbowroom::num::{End, Rational};

use crate::execution::scene::Scene;

fn domain(condition: &str, effects: &str) -> String {
    format!(
        "(define (domain filling)
          (:requirements :durative-actions :fluents)
          (:predicates (done))
          (:functions (tank) (paid) (used))
          (:durative-action fill :parameters () :duration (= ?duration 2)
            :condition {condition}
            :effect (and {effects} (at end (done)))))"
    )
}

fn scene(condition: &str, effects: &str, goal: &str) -> Scene {
    let problem = format!(
        "(define (problem p) (:domain filling)
          (:init (= (tank) 0) (= (paid) 0) (= (used) 0)) (:goal (and (done) {goal})))"
    );
    let mut scene = Scene::new(&domain(condition, effects), &problem, Some("0: (fill) [2]"));
    scene.settings.max_replans = 0;
    scene.settings.timeout = TimeoutRule::Off;
    scene.flow.timeout = TimeoutRule::Off;
    scene
}

/// Returns the upper end of the only interval.
fn upper(scene: &Scene) -> End {
    let mut request = EnvelopeRequest::new(&scene.task, scene.plan.clone());
    request.timeout = TimeoutRule::Off;
    request.search.sharpen = true;
    let outcome = envelope(&request, &mut NoObserver).expect("within exact analysis");
    let envelope = outcome.envelope.expect("an envelope");
    envelope.intervals()[0].upper.clone()
}

/// Returns `true` if a run reaches the goal in a world with this duration of `(fill)`. The
/// validator must agree.
fn works(scene: &Scene, executor: &str, takes: &Rational) -> bool {
    let model = scene.world(&format!(
        "resolution = 0.0001\n[[duration]]\naction = \"fill\"\nconstant = {}\n",
        takes.to_decimal(4)
    ));
    let report = scene.run(executor, &model, 0);
    let is_reached = report.verdict == Verdict::GoalReached;
    assert_eq!(scene.judged(&report).is_valid(), is_reached, "{report:#?}");
    is_reached
}

/// Checks that the envelope ends at `limit`, that runs up to there reach the goal, and that longer
/// ones do not.
fn assert_limit(scene: &Scene, limit: Option<&Rational>) {
    let expected = limit.cloned().map_or(End::Infinite, End::Closed);
    assert_eq!(upper(scene), expected);
    for executor in ["guarded", "live"] {
        match limit {
            Some(limit) => {
                assert!(works(scene, executor, limit), "{executor}");
                let beyond = limit + Rational::new(1, 100);
                assert!(!works(scene, executor, &beyond), "{executor}");
            }
            None => assert!(works(scene, executor, &Rational::from(200)), "{executor}"),
        }
    }
}

#[test]
fn effect_at_start_uses_the_planned_duration() {
    // The level of the tank grows with the real duration.
    let effects = "(at start (increase (paid) (* 2 ?duration))) (increase (tank) (* #t 2))";
    let scene = scene("(and)", effects, "(>= (paid) (tank))");
    assert_limit(&scene, Some(&Rational::from(2)));
    let effects = "(at start (increase (paid) (* 3 ?duration))) (increase (tank) (* #t 2))";
    let scene = self::scene("(and)", effects, "(>= (paid) (tank))");
    assert_limit(&scene, Some(&Rational::from(3)));
}

#[test]
fn effect_at_start_is_the_same_however_long_the_action_takes() {
    let effects = "(at start (increase (paid) (* 2 ?duration)))";
    assert_limit(&scene("(and)", effects, "(<= (paid) 4)"), None);
}

#[test]
fn effect_at_end_reads_the_real_duration() {
    let effects = "(at end (increase (used) ?duration))";
    let limit = Some(Rational::from(7));
    assert_limit(&scene("(and)", effects, "(<= (used) 7)"), limit.as_ref());
}

#[test]
fn condition_at_start_reads_the_planned_duration() {
    assert_limit(
        &scene("(at start (<= ?duration (+ 2 (tank))))", "", ""),
        None,
    );
}

#[test]
fn condition_at_end_reads_the_real_duration() {
    let limit = Some(Rational::from(5));
    assert_limit(
        &scene("(at end (<= ?duration (+ 5 (tank))))", "", ""),
        limit.as_ref(),
    );
}

#[test]
fn over_all_condition_reads_the_planned_duration() {
    // The tank holds 4 times the planned duration, and fills at 2 in each unit of time.
    let effects = "(increase (tank) (* #t 2))";
    let scene = scene("(over all (<= (tank) (* 4 ?duration)))", effects, "");
    assert_limit(&scene, Some(&Rational::from(4)));
}

#[test]
fn rate_reads_the_planned_duration() {
    // The tank fills at the planned duration in each unit of time.
    let effects = "(increase (tank) (* #t ?duration))";
    let limit = Some(Rational::from(5));
    assert_limit(&scene("(and)", effects, "(<= (tank) 10)"), limit.as_ref());
}
