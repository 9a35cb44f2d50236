//! `policy` without its table: it evaluates moves by rollouts in samples of the world.
//!
//! `ELBOWROOM_TRIALS=400` sets the number of trials of each world, and the table is printed
//! (`--nocapture`); `ELBOWROOM_WORLDS="clumsy vase"` selects worlds, and
//! `ELBOWROOM_EXECUTORS="policy live"` executors.

#![allow(clippy::print_stdout, reason = "the table is worth seeing")]

use crate::shared::results;
use elbowroom::execute::FirstPlan;
use elbowroom_laboratory::compare::{Column, Experiment};

/// `policy`, and the executors for comparison.
const EXECUTORS: &str = "policy live:5 adaptable guarded esterel";

fn env_or_default(name: &str, default: &str) -> String {
    std::env::var(name).unwrap_or_else(|_| default.to_owned())
}

/// Returns an experiment in which `policy` has no table.
fn experiment(name: &str) -> Experiment {
    let executors = env_or_default("ELBOWROOM_EXECUTORS", EXECUTORS);
    let executors = executors
        .split_whitespace()
        .map(|it| it.parse().expect("a name"));
    Experiment {
        executors: executors.collect(),
        first_plan: FirstPlan::Shortest,
        optimum: false,
        clairvoyant: false,
        table_states: 0,
        ..crate::shared::experiment(name)
    }
}

/// Optimum without foresight, by the bounds in docs/research/experiments.md, minus a tolerance of three
/// standard errors of 40 trials and five points.
const NEAR: [(&str, f64); 2] = [("weld", 0.957 - 0.15), ("vase", 0.976 - 0.13)];

#[test]
#[allow(clippy::cast_precision_loss, reason = "there are few trials")]
fn policy_without_table_is_near_optimum() {
    let trials = env_or_default("ELBOWROOM_TRIALS", "40")
        .parse()
        .expect("a number");
    for name in env_or_default("ELBOWROOM_WORLDS", "vase weld").split_whitespace() {
        let mut experiment = experiment(name);
        if let Ok(only) = std::env::var("ELBOWROOM_COLUMN") {
            let is_meant = |column: &Column| column.name.contains(&only);
            experiment.columns.retain(is_meant);
        }
        let results = results(&experiment, 2, trials);
        for (column, place) in experiment.columns.iter().enumerate() {
            for (row, executor) in results.counts.rows.iter().enumerate() {
                let cell = &results.counts.cells[row][column];
                let pair = results.counts.pairs[row][column];
                println!(
                    "{name} {}: {executor} {} of {}, {} replans; only policy {}, only {executor} {}; {:?}",
                    place.name,
                    cell.successes,
                    cell.runs,
                    cell.replans,
                    pair.only_first,
                    pair.only_this,
                    cell.causes,
                );
                let (lost, won) = (pair.only_this as f64, pair.only_first as f64);
                assert!(
                    lost - won <= 3.0 * (lost + won).sqrt(),
                    "{name}: {executor} is better: {lost} against {won}"
                );
            }
            let share = results.counts.cells[0][column].successes as f64 / trials as f64;
            for (_, near) in NEAR.iter().filter(|(near, _)| *near == name) {
                assert!(share >= *near, "{name}: {share} is not near the optimum");
            }
        }
    }
}

#[test]
fn rollouts_do_not_depend_on_number_of_threads() {
    let mut experiment = experiment("weld");
    experiment.executors.truncate(1);
    let (one, many) = (results(&experiment, 1, 6), results(&experiment, 3, 6));
    assert_eq!(one.json(), many.json());
}
