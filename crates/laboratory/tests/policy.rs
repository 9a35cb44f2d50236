//! `policy` beside the timed optimum and beside all other executors, in the worlds of `experiments`.
//!
//! `ELBOWROOM_TRIALS=2000` makes that many trials of each world, and the table is printed
//! (`--nocapture`).

use elbowroom_laboratory::compare::{Experiment, Part, Results, run};
use elbowroom_pddl::Source;

fn experiment(name: &str) -> Experiment {
    let folder = format!("{}/../../experiments", env!("CARGO_MANIFEST_DIR"));
    let file = |path: &str| {
        std::fs::read_to_string(format!("{folder}/{path}")).map_err(|error| error.to_string())
    };
    let text = file(&format!("{name}.toml")).expect("it is there");
    Experiment::read(Source::new(name, text.as_str()), &file).expect("it is an experiment")
}

fn trials() -> u64 {
    let told = std::env::var("ELBOWROOM_TRIALS").ok();
    told.map_or(200, |told| told.parse().expect("a number of trials"))
}

fn results(name: &str, jobs: usize, trials: u64) -> Results {
    let experiment = experiment(name);
    let part = Part {
        trials,
        shard: 0,
        shards: 1,
        jobs,
    };
    let results = run(&experiment, part, &|_| true).expect("it runs");
    println!("{name}\n{}", results.records().csv());
    results
}

/// Three standard errors of a share.
#[allow(clippy::cast_precision_loss, reason = "there are few trials")]
fn doubt(share: f64, trials: u64) -> f64 {
    3.0 * (share * (1.0 - share)).sqrt() / (trials as f64).sqrt()
}

#[allow(clippy::cast_precision_loss, reason = "there are few trials")]
fn is_near_the_optimum_and_above_all_others(name: &str) {
    let trials = trials();
    let results = results(name, 0, trials);
    let optimum = &results.optimum[0];
    assert!(optimum.unknown.is_none(), "{optimum:?}");
    assert!(optimum.upper - optimum.lower <= 0.01, "{optimum:?}");
    assert_eq!(results.rows[0], "policy");
    let share = results.cells[0][0].successes as f64 / results.cells[0][0].runs as f64;
    let doubt = doubt(optimum.lower, trials);
    assert!(
        share >= optimum.upper - 0.02 - doubt && share <= optimum.upper + doubt,
        "{name}: {share} beside {optimum:?}"
    );
    // In the same worlds, whoever is not worse loses about as often as it wins.
    let rows = results.rows.iter().enumerate();
    for (row, name) in rows.filter(|(_, name)| *name != "clairvoyant") {
        let pair = results.pairs[row][0];
        let (lost, won) = (pair.only_this as f64, pair.only_first as f64);
        assert!(
            lost - won <= 3.0 * (lost + won).sqrt(),
            "{name} is better: {lost} against {won}"
        );
    }
}

#[test]
fn two_seams_are_welded_before_the_shift_ends() {
    is_near_the_optimum_and_above_all_others("weld");
}

#[test]
fn a_rover_is_back_before_it_gets_dark() {
    is_near_the_optimum_and_above_all_others("detour");
}

#[test]
fn two_robots_hand_over_a_box_before_the_ramp_closes() {
    is_near_the_optimum_and_above_all_others("rendezvous");
}

#[test]
fn a_key_is_fetched_from_behind_a_door() {
    is_near_the_optimum_and_above_all_others("door");
}

#[test]
fn machines_are_maintained_all_at_once() {
    is_near_the_optimum_and_above_all_others("machines");
}

#[test]
fn the_same_seed_leads_to_the_same_runs_on_any_number_of_threads() {
    let one = results("weld", 1, 40);
    let two = results("weld", 2, 40);
    assert_eq!(one.json(), two.json());
}
