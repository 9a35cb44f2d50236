//! From one plan to the next, while time passes and things go on.

use elbowroom::execution::run::{PlanningTime, RunningRule, Verdict};
use elbowroom::num::Rational;

use crate::scene::{EXECUTORS, Scene};

/// Ends come in while a plan is made: they are no steps of the plan that is given up, and the new
/// plan, which goes on with what runs, must not wait for them.
#[test]
fn what_ends_while_a_plan_is_made_has_ended_for_the_new_plan() {
    for name in ["delivery", "match"] {
        let mut scene = Scene::case(name);
        scene.settings.running = RunningRule::Keep;
        let world = scene.world(
            "[[duration]]\naction = \"*\"\nnormal = { mean = 1, deviation = 0.3, minimum = 0.2 }\n\
             relative = true\n[[failure]]\naction = \"*\"\nprobability = 0.3\nwhen = \"start\"\n",
        );
        for executor in EXECUTORS {
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
