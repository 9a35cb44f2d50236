//! Worlds that lose, repeat, delay and contradict their reports.

use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::{RunningRule, Verdict};
use elbowroom::sim::{Distribution, ReportReliability};

use crate::execution::scene::{EXECUTORS, Scene, runs};

/// There must be no panic, no hang, and no wrong "goal reached". `ELBOWROOM_BAD_RUNS` sets the
/// number of runs, and `ELBOWROOM_BAD_FIRST` the first one.
#[test]
fn contradictory_reports_are_rejected() {
    let mut scenes = [
        Scene::case("delivery"),
        Scene::case("match"),
        Scene::two_orders("480", "800"),
    ];
    let count = runs("ELBOWROOM_BAD_RUNS", 240);
    let mut reached = 0;
    let mut ends = std::collections::BTreeMap::new();
    let first = runs("ELBOWROOM_BAD_FIRST", 0);
    for run in first..first + count {
        let which = usize::try_from(run).unwrap() % scenes.len();
        let scene = &mut scenes[which];
        let rules = [RunningRule::Cancel, RunningRule::Await, RunningRule::Keep];
        scene.settings.running = rules[usize::try_from(run / 3).unwrap() % 3];
        let executor = EXECUTORS[usize::try_from(run / 9).unwrap() % EXECUTORS.len()];
        let model = scene.world(
            "[[duration]]\naction = \"*\"\nnormal = { mean = 1, deviation = 0.2, minimum = 0.2 }\n\
             relative = true\n\
             [[failure]]\naction = \"*\"\nprobability = 0.03\nwhen = \"midway\"\n\
             [[delay]]\naction = \"*\"\nvalues = [0, 0, 0, 1.5]\n",
        );
        let mut analyst = PlanPreparer::new(scene.flow.clone());
        let (report, is_goal) = scene.run_badly(executor, &model, &bad(run), run, &mut analyst);
        if report.verdict == Verdict::GoalReached {
            assert!(is_goal, "run {run}, {executor}: {report:#?}");
            reached += 1;
        }
        assert!(report.time <= scene.settings.time_limit);
        *ends.entry(report.verdict.name()).or_insert(0) += 1;
    }
    assert!(
        reached > count / 10,
        "hardly any run came through: {ends:?}"
    );
    assert!(ends.len() > 1, "no run was disturbed: {ends:?}");
}

/// Returns each kind of fault separately, and all of them together.
fn bad(run: u64) -> ReportReliability {
    let mut reports = ReportReliability {
        lateness: Distribution::Uniform {
            from: 0.0,
            to: 40.0,
        }
        .into(),
        ..ReportReliability::default()
    };
    match run % 5 {
        0 => reports.lost = 0.1,
        1 => reports.duplicated = 0.5,
        2 => reports.late = 0.3,
        3 => reports.contradicted = 0.1,
        _ => {
            reports.lost = 0.05;
            reports.duplicated = 0.1;
            reports.late = 0.1;
            reports.contradicted = 0.05;
        }
    }
    reports
}
