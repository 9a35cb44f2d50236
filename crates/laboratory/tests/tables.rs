//! The timed optimum of problems of the published tables.

use elbowroom_laboratory::compare::{ColumnOptimum, Experiment, Part, run};
use elbowroom_pddl::Source;

/// The optimum of a table's columns, of the problem that one gets with the first of what may be filled in.
fn of_first_problem(name: &str) -> Vec<ColumnOptimum> {
    let folder = format!("{}/../../experiments", env!("CARGO_MANIFEST_DIR"));
    let file = |path: &str| {
        std::fs::read_to_string(format!("{folder}/{path}")).map_err(|error| error.to_string())
    };
    let text = file(&format!("{name}.toml")).expect("it is there");
    let read = Experiment::read(Source::new(name, text.as_str()), &file);
    let mut experiment = Experiment {
        executors: vec!["fixed:0".parse().expect("a name")],
        published: Vec::new(),
        optimum: true,
        ..read.expect("it is an experiment")
    };
    for (_, values) in &mut experiment.blanks {
        values.truncate(1);
    }
    for group in &mut experiment.together {
        group.rows.truncate(1);
    }
    let part = Part {
        trials: 1,
        shard: 0,
        shards: 1,
        jobs: 0,
    };
    run(&experiment, part, &|_| true).expect("it runs").optimum
}

/// Both windows close as early as they do in any problem. Whoever goes for the far one is nearly always in
/// time, however many steps vary.
#[test]
fn in_the_tightest_problem_of_table_1_hardly_anything_need_be_lost() {
    let columns = of_first_problem("table1");
    assert_eq!(columns.len(), 5);
    for optimum in columns {
        assert!(optimum.unknown.is_none(), "{optimum:?}");
        assert!(optimum.lower >= 0.99 && optimum.upper <= 1.0, "{optimum:?}");
    }
}
