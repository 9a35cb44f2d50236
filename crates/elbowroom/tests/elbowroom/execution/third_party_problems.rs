//! Benchmark problems in worlds with failing starts.

use elbowroom::execution::run::Verdict;

use crate::execution::scene::Scene;
use crate::shared;

/// Executors of paper 2.
const BY_LIKELIHOODS: &[&str] = &["adaptable", "esterel", "lookahead"];

/// Robot deliveries with batteries and deadlines, and rovers with and without energy.
const PROBLEMS: &[(&str, &[&str])] = &[
    (
        "delivery_battery/domain.pddl",
        &["delivery_battery/p1.pddl", "delivery_battery/p2.pddl"],
    ),
    (
        "pddl/ipc-2002/rovers-time-simple-automatic/domain.pddl",
        &[
            "pddl/ipc-2002/rovers-time-simple-automatic/instances/instance-1.pddl",
            "pddl/ipc-2002/rovers-time-simple-automatic/instances/instance-2.pddl",
        ],
    ),
    (
        "pddl/ipc-2002/rovers-time-automatic/domain.pddl",
        &[
            "pddl/ipc-2002/rovers-time-automatic/instances/instance-1.pddl",
            "pddl/ipc-2002/rovers-time-automatic/instances/instance-2.pddl",
        ],
    ),
    (
        "pddl/strathclyde/rovers-metric-time-2006/domain.pddl",
        &["pddl/strathclyde/rovers-metric-time-2006/instances/instance-1.pddl"],
    ),
];

#[test]
fn third_party_problems_are_executed_unchanged() {
    let Some(data) = shared::data() else { return };
    let read = |path: &str| {
        let bytes = std::fs::read(data.join(path)).expect("a file of the data");
        String::from_utf8_lossy(&bytes).into_owned()
    };
    let chances = "
        [defaults]
        becomes_true = 0.001
        becomes_false = 0.01
        start = 0.8
        effect = 0.95";
    for (domain, problems) in PROBLEMS {
        for problem in *problems {
            let scene = Scene::new(&read(domain), &read(problem), None).with_likelihoods(chances);
            let failing = "[[failure]]\naction = \"*\"\nwhen = \"start\"\nprobability = 0.2";
            for (world, seeds) in [("", 1), (failing, 3)] {
                for seed in 0..seeds {
                    for executor in BY_LIKELIHOODS {
                        let report = scene.run(executor, &scene.world(world), seed);
                        let words = format!("{problem}, {executor}, {seed}: {:?}", report.reasons);
                        assert_eq!(report.verdict, Verdict::GoalReached, "{words}");
                        assert!(scene.judged(&report).is_valid(), "{words}");
                    }
                }
            }
        }
    }
}
