//! Transitions between plans during a run.

use elbowroom::execution::run::{PlanningTime, RunningRule, Verdict};
use elbowroom::num::Rational;

use crate::execution::scene::{EXECUTORS, Scene};

/// Actions that end during planning are not steps of the abandoned plan. The new plan, which
/// continues with the running actions, must not wait for them.
#[test]
fn action_that_ends_during_planning_is_over_in_new_plan() {
    for name in ["delivery", "match"] {
        let mut scene = Scene::case(name);
        scene.settings.running = RunningRule::Keep;
        let world = scene.world(
            "[[duration]]\naction = \"*\"\nnormal = { mean = 1, deviation = 0.3, minimum = 0.2 }\n\
             relative = true\n[[failure]]\naction = \"*\"\nprobability = 0.3\nwhen = \"start\"\n",
        );
        for executor in EXECUTORS.iter() {
            let (mut replans, mut reached) = (0, 0);
            for seed in 0..40 {
                scene.settings.planning_time = PlanningTime::Seconds(Rational::new(seed % 7, 2));
                let seed = u64::try_from(seed).unwrap();
                let report = scene.run(executor, &world, seed);
                replans += report.replans;
                if report.verdict == Verdict::GoalReached {
                    reached += 1;
                    let verdict = scene.judged(&report);
                    assert!(verdict.is_valid(), "{executor}, {seed}: {verdict:?}");
                }
            }
            assert!(reached > 0, "{name}, {executor}");
            assert!(replans > 0 || *executor == "esterel", "{name}, {executor}");
        }
    }
}

/// The first drive does not start while the door is being unlocked, so the new plan continues with
/// the unlocking. A bug once treated it as another step of the new plan and repeated it endlessly.
#[test]
fn running_action_is_not_restarted_by_new_plan() {
    let scene = Scene::case("delivery");
    let world = scene.world(
        "[[failure]]\naction = \"*\"\nprobability = 0.3\nwhen = \"start\"\n\
         [[duration]]\naction = \"drive\"\nconstant = 1.1\nrelative = true\n",
    );
    for executor in EXECUTORS.iter() {
        let mut replans = 0;
        for seed in 0..60 {
            let report = scene.run(executor, &world, seed);
            replans += report.replans;
            let executed = &report.executed;
            for (index, one) in executed.iter().enumerate() {
                let again = executed[index + 1..].iter().any(|other| {
                    one.step.action.name == other.step.action.name
                        && other.step.start < one.step.end()
                });
                assert!(!again, "{executor}, {seed}: {report:#?}");
            }
        }
        assert!(replans > 0 || matches!(*executor, "esterel" | "adaptable" | "lookahead"));
    }
}
