//! Within the guarantee nothing fails.

use std::fmt::Write as _;
use std::sync::Arc;

use elbowroom::execute::{Analyst, RememberingPreparer};
use elbowroom::execution::NoRecord;
use elbowroom::execution::run::Verdict;
use elbowroom::num::Rational;
use elbowroom::plan::ParameterKind;
use elbowroom::sim::{SimWorld, WorldModel};

use crate::scene::{Scene, runs};

/// In worlds where every duration stays in its interval, `guarded` always reaches the goal, never
/// replans, and the judge accepts what was done. `ELBOWROOM_GUARANTEED_RUNS` says how many runs
/// (100,000 take a few minutes).
#[test]
fn within_the_envelope_the_goal_is_always_reached() {
    let scenes = [
        ("delivery", Scene::case("delivery")),
        ("match", Scene::case("match")),
        ("two orders", Scene::two_orders("480", "800")),
    ];
    let count = runs("ELBOWROOM_GUARANTEED_RUNS", 300) / scenes.len() as u64;
    for (name, scene) in scenes {
        let model = world_of_the_envelope(&scene);
        let mut preparer = RememberingPreparer::new(Analyst::new(scene.flow.clone()), 1);
        for seed in 0..count {
            let mut world = SimWorld::new(Arc::clone(&scene.task), &model, seed);
            let report = scene.run_in("guarded", &mut world, &mut preparer, &mut NoRecord);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{name}, seed {seed}: {report:#?}"
            );
            assert_eq!(
                report.replans, 0,
                "{name}, seed {seed}: {:?}",
                report.reasons
            );
            let verdict = scene.judged(&report);
            assert!(verdict.is_valid(), "{name}, seed {seed}: {verdict:?}");
        }
    }
}

/// Every duration is anywhere in its interval of the first plan's envelope, all values alike.
fn world_of_the_envelope(scene: &Scene) -> WorldModel {
    let prepared = scene.prepared("guarded");
    let envelope = prepared.envelope.expect("a correct test");
    let mut sections = String::new();
    for (index, parameter) in prepared.plan.parameters.iter().enumerate() {
        let ParameterKind::Duration(instance) = parameter.kind else {
            panic!("only durations are open by default");
        };
        let thousand = Rational::from(1000);
        let interval = &envelope.intervals[index];
        let lower = interval.lower.value().expect("a correct test");
        let farthest = &parameter.nominal * Rational::from(3);
        let upper = interval.upper.value().unwrap_or(&farthest);
        // Thousandths, rounded inwards.
        let from = (lower * &thousand).ceil() / &thousand;
        let to = (upper * &thousand).floor() / &thousand;
        let name = &prepared.plan.plan.instance(instance).action.name;
        let (from, to) = (from.to_f64(), to.to_f64());
        let _ = writeln!(
            sections,
            "[[duration]]\naction = \"{name}\"\nuniform = {{ from = {from}, to = {to} }}"
        );
    }
    scene.world(&sections)
}
