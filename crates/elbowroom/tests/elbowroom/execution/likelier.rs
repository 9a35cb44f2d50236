//! `live:X` replaces a plan by a likelier one.

use elbowroom::execution::Cause;
use elbowroom::execution::run::Verdict;
use elbowroom::sim::WorldModel;

use crate::execution::scene::Scene;

/// Returns a problem with two orders. The nearer one has almost no slack.
fn hasty_order() -> (Scene, WorldModel) {
    let scene = Scene::two_orders("425", "800");
    let model = scene.world(
        "[[duration]]\naction = \"make-base-1\"\n\
         normal = { mean = 170, deviation = 70, minimum = 0 }\n\
         [[duration]]\naction = \"make-base-2\"\n\
         normal = { mean = 160, deviation = 70, minimum = 0 }\n",
    );
    (scene, model)
}

#[test]
fn improbable_order_is_replaced_by_likelier_one() {
    let (scene, model) = hasty_order();
    let first = scene
        .plan
        .steps
        .iter()
        .map(|step| step.action.name.as_str());
    assert!(
        first
            .clone()
            .any(|name| name.contains("deliver rover front simple"))
    );
    let count = 30;
    let (mut patient, mut prudent) = (0, 0);
    for seed in 0..count {
        let report = scene.run("live", &model, seed);
        patient += u32::from(report.verdict == Verdict::GoalReached);
        let report = scene.run_likeliest("live:5", &model, seed);
        prudent += u32::from(report.verdict == Verdict::GoalReached);
        let why = report.reasons.first().expect("the first plan is given up");
        assert_eq!(why.cause, Cause::Likelier, "{report:#?}");
    }
    println!("{prudent} against {patient} of {count}");
    // Without considering probabilities, an order is abandoned only when it is late, and then it is
    // too late for the other one.
    assert!(
        prudent >= patient + 5,
        "{prudent} against {patient} of {count}"
    );
    assert!(
        prudent * 10 >= 9 * u32::try_from(count).expect("few"),
        "{prudent} of {count}"
    );
}

#[test]
fn no_likelier_plan_without_deviations() {
    for scene in [
        Scene::case("delivery"),
        Scene::case("match"),
        hasty_order().0,
    ] {
        let model = WorldModel::without_deviations();
        let plain = scene.run("live", &model, 0);
        assert_eq!(scene.run_likeliest("live:0", &model, 0), plain);
    }
}

#[test]
fn small_advantage_causes_no_replan() {
    let (scene, model) = hasty_order();
    let plain = scene.run("live", &model, 3);
    assert_eq!(scene.run_likeliest("live:100", &model, 3), plain);
}
