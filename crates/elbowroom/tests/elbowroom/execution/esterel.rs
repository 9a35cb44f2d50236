//! Baseline of paper 2 on a clock.

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::execution::{Cause, Subject};
use elbowroom::num::Rational;

use crate::execution::scene::Scene;

fn fails_at(when: &str, action: &str, probability: &str) -> String {
    format!("[[failure]]\naction = \"{action}\"\nwhen = \"{when}\"\nprobability = {probability}\n")
}

fn count(report: &Report, action: &str) -> usize {
    let names = report.executed.iter().map(|it| &it.step.action.name);
    names.filter(|name| name.contains(action)).count()
}

#[test]
fn failed_start_is_retried_without_replanning() {
    let scene = Scene::case("delivery");
    let world = scene.world(&fails_at("start", "*", "0.5"));
    let mut failures = 0;
    for seed in 0..20 {
        let report = scene.run("esterel", &world, seed);
        assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
        assert_eq!(report.replans, 0, "{:?}", report.reasons);
        assert!(scene.judged(&report).is_valid());
        failures += report.starts - 5;
    }
    assert!(failures > 40, "{failures}");
}

#[test]
fn repeatedly_failing_start_is_retried_with_backoff() {
    let scene = Scene::case("delivery");
    let world = scene.world(&fails_at("start", "drop", "1"));
    let report = scene.run("esterel", &world, 1);
    assert_eq!(report.verdict, Verdict::TimeLimit);
    assert_eq!(report.replans, 0);
    // ε (1 + 2 + 4 + …) is 100,000 s after 27 failures.
    let tries = report.starts - 4;
    assert!((20..30).contains(&tries), "{tries}");
}

#[test]
fn plan_is_abandoned_if_a_needed_condition_is_false() {
    let scene = Scene::case("delivery");
    let locked = "[[event]]\nfact = \"(unlocked office)\"\nbecomes = false\nconstant = 20\n";
    let report = scene.run("esterel", &scene.world(locked), 1);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert_eq!(report.replans, 1, "{:?}", report.reasons);
    let reason = &report.reasons[0];
    assert_eq!(reason.cause, Cause::Condition, "{reason}");
    assert_eq!(reason.action.as_deref(), Some("(drop rover parcel office)"));
    let unlocked = vec!["(unlocked office)".to_owned()];
    assert_eq!(reason.about, Some(Subject::Conditions(unlocked)));
    assert_eq!(count(&report, "unlock"), 2);
    assert!(scene.judged(&report).is_valid());
    // Only at the failure. `guarded` knows at 20 that the remaining plan is infeasible.
    assert!(report.executed.iter().any(|it| it.step.start > 27.into()));
}

#[test]
fn plan_is_abandoned_if_an_action_aborts() {
    let scene = Scene::case("delivery");
    let world = scene.world(&fails_at("midway", "unlock", "1"));
    let report = scene.run("esterel", &world, 1);
    assert_eq!(report.reasons[0].cause, Cause::Failed, "{report:#?}");
}

/// The counter closes at 60, so a drop that begins later than 57 fails.
#[test]
fn missed_deadline_is_detected_only_by_a_failure() {
    let scene = Scene::case("delivery");
    let late = "[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 50\n";
    let world = scene.world(late);
    let report = scene.run("esterel", &world, 1);
    assert_eq!(report.verdict, Verdict::Unsolvable, "{report:#?}");
    assert_eq!(count(&report, "drop"), 1);
    let reason = &report.reasons[0];
    assert_eq!(reason.cause, Cause::Failed, "{reason}");
    assert!(report.time > 60.into());
    // `stn` detects it as soon as the drive is late.
    assert!(scene.run("stn", &world, 1).time < Rational::from(51));
}
