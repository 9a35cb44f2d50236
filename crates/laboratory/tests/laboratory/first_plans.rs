//! Benefit of choosing the first plan by its probability, in the worlds of `experiments`.
//!
//! `ELBOWROOM_TRIALS=2000` sets the number of trials of each world, and the table is printed
//! (`--nocapture`); `ELBOWROOM_WORLDS="clumsy vase"` selects worlds.

#![allow(clippy::print_stdout, reason = "the table is worth seeing")]

use crate::shared::results;
use elbowroom::execute::FirstPlan;
use elbowroom_laboratory::compare::{Experiment, run};
use elbowroom_laboratory::trials::Part;
use elbowroom_pddl::Source;

fn experiment(name: &str, first_plan: FirstPlan) -> Experiment {
    Experiment {
        first_plan,
        optimum: false,
        clairvoyant: false,
        ..crate::shared::experiment(name)
    }
}

fn only(experiment: Experiment, executors: &[&str]) -> Experiment {
    let executors = executors.iter().map(|name| name.parse().expect("a name"));
    Experiment {
        executors: executors.collect(),
        ..experiment
    }
}

#[test]
fn likeliest_first_plans_are_never_worse_than_the_shortest() {
    let told = std::env::var("ELBOWROOM_TRIALS").ok();
    let trials: u64 = told.map_or(40, |told| told.parse().expect("a number of trials"));
    let worlds = std::env::var("ELBOWROOM_WORLDS").ok();
    let worlds = worlds.unwrap_or_else(|| "counter weld rendezvous".to_owned());
    for name in worlds.split_whitespace() {
        let all = |first_plan| {
            let read = experiment(name, first_plan);
            let executors: Vec<String> = read.executors.iter().map(ToString::to_string).collect();
            // The policy's table takes long, and the policy does not depend on the plan.
            let named: Vec<&str> = executors.iter().map(String::as_str).collect();
            let named: Vec<&str> = named.into_iter().filter(|it| *it != "policy").collect();
            only(read, &named)
        };
        let (shortest, likeliest) = (all(FirstPlan::Shortest), all(FirstPlan::Likeliest));
        let before = results(&shortest, 2, trials);
        let after = results(&likeliest, 2, trials);
        for (row, executor) in shortest.executors.iter().enumerate() {
            for (column, place) in shortest.columns.iter().enumerate() {
                let [before, after] =
                    [&before, &after].map(|results| results.counts.cells[row][column].successes);
                println!(
                    "{name} {}: {executor} {before} {after} of {trials}",
                    place.name
                );
                #[allow(clippy::cast_precision_loss, reason = "there are few trials")]
                let (lost, all) = (before as f64 - after as f64, trials as f64);
                // The choice and the trials have different samples. The tolerance is three points
                // and three standard errors of a difference.
                let doubt = 0.03 * all + 3.0 * (all * 0.25).sqrt();
                assert!(lost <= doubt, "{name}: {executor} {before} to {after}");
                if ["counter", "weld"].contains(&name) && executor.to_string() == "live" {
                    assert!(-lost > 0.2 * all, "{name}: {executor} {before} to {after}");
                }
            }
        }
    }
}

#[test]
fn choices_do_not_depend_on_the_number_of_threads() {
    let read = only(experiment("weld", FirstPlan::Likeliest), &["live", "stn"]);
    let (one, many) = (results(&read, 1, 12), results(&read, 5, 12));
    assert_eq!(one.counts.cells, many.counts.cells);
}

const DOMAIN: &str = "
    (define (domain d) (:requirements :durative-actions)
      (:predicates (done))
      (:durative-action quick :parameters () :duration (= ?duration 1) :condition () :effect (at end (done)))
      (:durative-action slow :parameters () :duration (= ?duration 5) :condition () :effect (at end (done))))";
const EXPERIMENT: &str = r#"
    format = "elbowroom-experiment"
    version = 1
    title = "Given plan"
    domain = "d"
    problem = "p"
    trials = 3
    max_replans = 0
    executors = ["guarded", "live", "stn"]
    plan = "x"
    [[column]]
    name = "w"
    world = "w"
"#;

/// Returns the experiment with this plan; `quick` always fails.
fn with_plan(plan: &str) -> Experiment {
    let file = |name: &str| {
        Ok(match name {
            "d" => DOMAIN,
            "p" => "(define (problem p) (:domain d) (:init) (:goal (done)))",
            "x" => plan,
            _ => {
                "format = \"elbowroom-world\"\nversion = 1\n[[failure]]\naction = \"quick\"\nprobability = 1.0\n"
            }
        }
        .to_owned())
    };
    Experiment::read(Source::new("given", EXPERIMENT), &file).expect("it is an experiment")
}

#[test]
fn executors_start_with_the_given_plan() {
    for (plan, successes) in [("0: (slow) [5]", 3), ("0: (quick) [1]", 0)] {
        let results = results(&with_plan(plan), 1, 3);
        assert!(
            (results.counts.cells.iter().flatten()).all(|cell| cell.successes == successes),
            "{plan}"
        );
    }
}

#[test]
fn plan_that_is_not_valid_for_the_problem_is_refused() {
    let part = Part::whole(1, 1);
    let refused = run(&with_plan("0: (slow) [4]"), part, &|_| true);
    let error = refused.expect_err("the duration is wrong").to_string();
    assert!(error.contains("`plan` is not valid"), "{error}");
}
