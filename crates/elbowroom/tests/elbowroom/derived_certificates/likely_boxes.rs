//! Boxes of the objective `probability`: the guarantee is derived from the files, the probability
//! from the world.

use std::sync::Arc;

use elbowroom::duration_distribution;
use elbowroom::envelope::Objective;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::pddl::Source;
use elbowroom::sim::WorldModel;
use elbowroom::verify::{AnswerError, Plan, Verified, verify_answer_in_world, verify_answer_of};
use serde_json::{Value, json};

use super::forgery::Forger;
use super::{GUARANTEES, answered, read, request, timed};

/// Distributions of all durations relative to the planned ones, each with a similar one.
const WORLDS: [[&str; 2]; 4] = [
    [
        "normal = { mean = 1, deviation = 0.15 }",
        "normal = { mean = 1, deviation = 0.16 }",
    ],
    [
        "triangular = { from = 0.8, mode = 1, to = 2 }",
        "triangular = { from = 0.8, mode = 1.1, to = 2 }",
    ],
    ["values = [0.9, 1, 1, 1.2]", "values = [0.9, 1, 1.2, 1.2]"],
    [
        "lognormal = { mean = 1.1, deviation = 0.2 }",
        "normal = { mean = 1.1, deviation = 0.2 }",
    ],
];

fn world(distribution: &str, task: &Task) -> WorldModel {
    let text = format!(
        "format = \"elbowroom-world\"\nversion = 1\n[[duration]]\naction = \"*\"\nrelative = true\n\
         {distribution}\n"
    );
    WorldModel::read(Source::new("world", text), task.problem()).expect("a world without mistakes")
}

fn verified_in(
    answer: &Value,
    (task, plan): (&Task, &TimeTriggeredPlan),
    world: &WorldModel,
) -> Result<Verified, AnswerError> {
    let distributions = |action: &str, planned: &_| {
        duration_distribution(action, planned, world).map_err(|wrong| wrong.to_string())
    };
    verify_answer_in_world(
        &answer.to_string(),
        task,
        Plan::Times(plan),
        Some(&distributions),
    )
}

#[test]
fn probability_is_checked_with_the_world_and_assumed_without_it() {
    let mut forger = Forger::new(0x5851_f42d_4c95_7f2d);
    let mut accepted = 0;
    for name in ["delivery", "hatchery", "match"] {
        let (task, plan) = timed(name);
        for worlds in WORLDS {
            let [own, other] = worlds.map(|distribution| world(distribution, &task));
            for guarantee in GUARANTEES {
                let mut request = request(&task, &plan, (guarantee, Objective::Probability));
                request.world = Some(Arc::new(own.clone()));
                let Some(answer) = answered(&request) else {
                    continue;
                };
                let what = format!("{name}, {guarantee:?}");
                let subject = (&*task, &plan);
                let verdict = verified_in(&answer, subject, &own);
                let verified = verdict.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(verified.assumes.is_empty(), "{what}");
                let without = verify_answer_of(&answer.to_string(), &task, &plan);
                let without = without.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert_eq!(without.assumes.len(), 1, "{what}: {:?}", without.assumes);
                let verdict = verified_in(&answer, subject, &other);
                assert!(
                    matches!(verdict, Err(AnswerError::Flaw(_))),
                    "{what}: {verdict:?}"
                );
                for place in ["least", "most"] {
                    let mut broken = answer.clone();
                    broken["best"]["probability"][place] = json!({ "exact": "1/2" });
                    let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
                    assert!(verdict.is_err(), "{what}: {place}");
                }
                let verify = |answer: &Value| verified_in(answer, subject, &own);
                forger.attack((&answer, 30), &verify, &what);
                accepted += 1;
            }
        }
    }
    assert!(accepted >= 10, "{accepted}");
    assert!(forger.print_counts() > 500);
}

/// Boxes that contain almost none of the drawn durations, and for which the search has no
/// logarithm.
#[test]
fn improbable_box_is_accepted_with_its_least_value_alone() {
    let domain = "(define (domain d) (:requirements :durative-actions) (:predicates (open) (done))
        (:durative-action work :parameters () :duration (= ?duration 2)
          :condition (at end (open)) :effect (at end (done))))";
    let problem =
        "(define (problem p) (:domain d) (:init (open) (at 2.01 (not (open)))) (:goal (done)))";
    let (task, plan) = read(domain, problem, "0: (work) [2]");
    let mut accepted = 0;
    for distribution in [
        "lognormal = { mean = 10, deviation = 0.05 }",
        "normal = { mean = 10, deviation = 0.01 }",
        "normal = { mean = 10, deviation = 1 }",
    ] {
        let own = world(distribution, &task);
        for guarantee in GUARANTEES {
            let mut request = request(&task, &plan, (guarantee, Objective::Probability));
            request.world = Some(Arc::new(own.clone()));
            let Some(answer) = answered(&request) else {
                continue;
            };
            let verdict = verified_in(&answer, (&task, &plan), &own);
            verdict.unwrap_or_else(|wrong| panic!("{distribution}, {guarantee:?}: {wrong}"));
            accepted += 1;
            for value in ["-1", "-999999", "-1000001"] {
                let mut broken = answer.clone();
                broken["best"]["value"] = json!({ "exact": value });
                let verdict = verified_in(&broken, (&task, &plan), &own);
                assert!(verdict.is_err(), "{distribution}: {value}");
            }
        }
    }
    assert!(accepted >= 3, "{accepted}");
}
