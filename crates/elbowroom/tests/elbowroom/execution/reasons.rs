//! Decisions of executors, and the reasons that they give.

use elbowroom::execution::run::{RunningRule, Verdict};
use elbowroom::execution::{Cause, Ending};

use crate::execution::scene::{EXECUTORS, Scene};

#[test]
fn executors_follow_the_plan_without_deviations() {
    for name in ["delivery", "match", "battery", "tank"] {
        let scene = Scene::case(name);
        let model = scene.world("");
        for executor in EXECUTORS.iter() {
            let report = scene.run(executor, &model, 0);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{name}, {executor}: {report:#?}"
            );
            assert_eq!(
                report.replans, 0,
                "{name}, {executor}: {:?}",
                report.reasons
            );
            let verdict = scene.judged(&report);
            assert!(verdict.is_valid(), "{name}, {executor}: {verdict:?}");
        }
    }
}

/// The flare burns for 15 instead of 30: there is too little time for the second inspection
/// (required concurrency), and there is no second flare.
#[test]
fn work_inside_flare_fails_with_the_flare() {
    let scene = Scene::case("match");
    let model = scene.world("[[duration]]\naction = \"burn\"\nconstant = 15\n");
    for executor in EXECUTORS.iter() {
        let report = scene.run(executor, &model, 0);
        assert_eq!(
            report.verdict,
            Verdict::Unsolvable,
            "{executor}: {report:#?}"
        );
    }
}

#[test]
fn overlong_drive_is_detected_while_running() {
    let scene = Scene::case("delivery");
    let model = scene.world("[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 55\n");
    let report = scene.run("guarded", &model, 0);
    let reason = &report.reasons[0];
    assert_eq!(reason.cause, Cause::Outlived, "{reason}");
    assert_eq!(reason.action.as_deref(), Some("(drive rover depot shelf)"));
    let allowed = reason.allowed.as_ref().unwrap();
    let since = reason.since.as_ref().unwrap();
    // It started at 0, so it exceeded its interval when the interval ended.
    assert_eq!(Some(since), allowed.upper.value());
    assert!(report.time < 55.into(), "{report:#?}");
}

/// Nominally everything after the drive takes 20.003, and the counter closes at 60. The parcel can
/// be in time until 39.996, and `live` does not abandon the plan before.
#[test]
fn live_abandons_plan_exactly_when_deadline_is_unreachable() {
    let scene = Scene::case("delivery");
    for (drive, is_reached) in [("39.9", true), ("40.1", false)] {
        let model = scene.world(&format!(
            "[[duration]]\naction = \"(drive _ depot _)\"\nconstant = {drive}\n"
        ));
        let report = scene.run("live", &model, 0);
        let is_as_expected = match &report.verdict {
            Verdict::GoalReached => is_reached,
            Verdict::Unsolvable | Verdict::NoPlan { .. } => !is_reached,
            _ => false,
        };
        assert!(is_as_expected, "{drive}: {report:#?}");
    }
    let model = scene.world("[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 50\n");
    let report = scene.run("live", &model, 0);
    let reason = &report.reasons[0];
    assert_eq!(reason.cause, Cause::Unreachable, "{reason}");
    let deadline = "(counter-open office) becomes false at 60";
    assert!(
        reason
            .evidence
            .iter()
            .any(|it| it.to_string().contains(deadline)),
        "{reason}"
    );
}

#[test]
fn fixed_replans_when_a_duration_leaves_the_percentage() {
    let scene = Scene::case("delivery");
    let late = "[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 13\n";
    let model = scene.world(late);
    assert_eq!(scene.run("fixed:30", &model, 0).replans, 0);
    let report = scene.run("fixed:29", &model, 0);
    assert_eq!(report.replans, 1, "{report:#?}");
    assert_eq!(report.reasons[0].cause, Cause::Outlived);
    let early = "[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 6.5\n";
    let report = scene.run("fixed:30", &scene.world(early), 0);
    assert_eq!(
        report.reasons[0].cause,
        Cause::OutsideInterval,
        "{report:#?}"
    );
    assert_eq!(report.verdict, Verdict::GoalReached);
}

#[test]
fn failed_action_is_compensated() {
    let scene = Scene::case("delivery");
    let model = scene.world("[[failure]]\naction = \"drop\"\nprobability = 1\nwhen = \"start\"\n");
    let report = scene.run("guarded", &model, 0);
    // It fails every time, until the counter closes.
    assert_eq!(report.reasons[0].cause, Cause::Failed);
    assert_ne!(report.verdict, Verdict::GoalReached);
    assert!(report.replans > 1, "{report:#?}");
}

#[test]
fn running_actions_are_cancelled_awaited_or_kept() {
    let mut scene = Scene::case("delivery");
    // The drive is late during the long unlocking of the office.
    let model = scene.world(
        "[[duration]]\naction = \"(drive _ depot _)\"\nconstant = 6\n\
         [[duration]]\naction = \"unlock\"\nconstant = 7\n",
    );
    for (rule, is_stopped) in [
        (RunningRule::Cancel, true),
        (RunningRule::Await, false),
        (RunningRule::Keep, false),
    ] {
        scene.settings.running = rule;
        let report = scene.run("fixed:20", &model, 0);
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{rule:?}: {report:#?}"
        );
        let mut unlocking = report.executed.iter();
        let first = unlocking.find(|it| it.step.action.name == "(unlock office)");
        let ending = first.and_then(|it| it.ending.clone());
        assert_eq!(
            ending == Some(Ending::Cancelled),
            is_stopped,
            "{rule:?}: {report:#?}"
        );
        let verdict = scene.judged(&report);
        assert!(verdict.is_valid(), "{rule:?}: {verdict:?}");
    }
}

/// Somebody else carries the parcel to the office, so no step remains.
#[test]
fn spontaneous_change_triggers_replanning() {
    let scene = Scene::case("delivery");
    let moved = "[[event]]\nfact = \"(lies parcel shelf)\"\nbecomes = false\nconstant = 5\n";
    let report = scene.run("guarded", &scene.world(moved), 0);
    assert_eq!(report.reasons[0].cause, Cause::Surprise, "{report:#?}");
    assert_eq!(report.verdict, Verdict::Unsolvable);
    let irrelevant = "[[event]]\nfact = \"(unlocked shelf)\"\nbecomes = true\nconstant = 5\n";
    assert_eq!(scene.run("guarded", &scene.world(irrelevant), 0).replans, 0);
    // With [`RunningRule::Keep`] the run waits for running actions.
    let mut scene = scene;
    scene.settings.running = RunningRule::Cancel;
    let helped = "[[event]]\nfact = \"(lies parcel office)\"\nbecomes = true\nconstant = 5\n\
                  [[event]]\nfact = \"(lies parcel shelf)\"\nbecomes = false\nconstant = 5\n";
    let report = scene.run("guarded", &scene.world(helped), 0);
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert!(report.time < 10.into());
}

#[test]
fn planning_time_reduces_time_to_deadline() {
    let mut scene = Scene::case("delivery");
    let model = scene.world(
        "[[failure]]\naction = \"(drive _ depot _)\"\nprobability = 0.6\nwhen = \"start\"\n",
    );
    let seeds = 0..40;
    let reached = |scene: &Scene| {
        let seeds = seeds.clone();
        seeds
            .filter(|seed| scene.run("guarded", &model, *seed).verdict == Verdict::GoalReached)
            .count()
    };
    let at_once = reached(&scene);
    scene.settings.planning_time =
        elbowroom::execution::run::PlanningTime::Seconds(elbowroom::num::Rational::from(14));
    let slowly = reached(&scene);
    assert!(slowly < at_once, "{slowly} < {at_once}");
    assert!(slowly > 0);
}
