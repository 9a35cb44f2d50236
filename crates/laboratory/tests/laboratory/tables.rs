//! Timed optimum for problems of the published tables.

use elbowroom_laboratory::compare::{ColumnOptimum, Experiment};

/// Returns the optimum of a table's columns for the first problem.
fn of_first_problem(name: &str) -> Vec<ColumnOptimum> {
    let mut experiment = experiment(name);
    for (_, values) in &mut experiment.blanks {
        values.truncate(1);
    }
    for group in &mut experiment.linked {
        group.rows.truncate(1);
    }
    optimum_of(&experiment)
}

fn experiment(name: &str) -> Experiment {
    Experiment {
        executors: vec!["fixed:0".parse().expect("a name")],
        published: Vec::new(),
        optimum: true,
        ..crate::shared::experiment(name)
    }
}

fn optimum_of(experiment: &Experiment) -> Vec<ColumnOptimum> {
    crate::shared::results(experiment, 0, 1).counts.optimum
}

/// Both windows close at the earliest time of all problems. A policy that aims at the later one is
/// nearly always in time, however many steps vary.
#[test]
fn optimum_of_tightest_problem_of_table_1_is_near_1() {
    let columns = of_first_problem("table1");
    assert_eq!(columns.len(), 5);
    for optimum in columns {
        assert!(optimum.unknown.is_none(), "{optimum:?}");
        assert!(optimum.lower >= 0.99 && optimum.upper <= 1.0, "{optimum:?}");
    }
}

/// Making one workpiece after the other reaches 89.9 %. In addition, a workpiece that is too light
/// may get more material after the rings, because the model allows a workpiece to be picked up
/// again that was thrown away while it was being picked up.
#[test]
fn bounds_of_table_2_differ_by_at_most_one_point() {
    let mut experiment = experiment("table2_optimum");
    experiment.columns.truncate(1);
    // With the largest battery there is only one plan, and its recovery.
    for group in &mut experiment.linked {
        group.rows.drain(..group.rows.len() - 1);
    }
    let columns = optimum_of(&experiment);
    assert_eq!(columns.len(), 1);
    let optimum = &columns[0];
    assert!(optimum.upper - optimum.lower <= 0.01, "{optimum:?}");
    // The run is lost if the weight is too high and the next one is wrong. Draws are normal with
    // mean 85 and deviation 25; wrong is below 60 or above 110.
    let (heavy, wrong) = (0.1587, 0.3173);
    let least = heavy * wrong;
    assert!(
        optimum.lower <= 1.0 - least && optimum.upper >= 1.0 - least - 0.01,
        "{optimum:?}"
    );
    assert!(optimum.lower > 0.93, "{optimum:?}");
}
