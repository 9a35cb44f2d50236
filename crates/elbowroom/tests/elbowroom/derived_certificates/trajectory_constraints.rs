//! Certificates of plans with trajectory constraints, and of durations that the domain restricts by
//! numbers.

use std::sync::Arc;

use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::verify::{AnswerError, verify_answer_of};
use serde_json::{Value, json};

use super::forgery::{Forger, claim};
use super::{GUARANTEES, OBJECTIVES, answer, read};

const DOMAIN: &str = "
    (define (domain studio)
      (:requirements :durative-actions :timed-initial-literals :constraints :negative-preconditions
        :disjunctive-preconditions :fluents :duration-inequalities)
      (:predicates (lit) (quiet) (singing) (sung) (tuned))
      (:functions (patience))
      (:durative-action shine :parameters () :duration (= ?duration 20) :condition ()
        :effect (and (at start (lit)) (at end (not (lit)))))
      (:durative-action tune :parameters () :duration (= ?duration 3) :condition (at start (quiet))
        :effect (and (at start (not (quiet))) (at end (quiet)) (at end (tuned)) (at end (assign (patience) 12))))
      (:durative-action sing :parameters () :duration (and (>= ?duration 2) (<= ?duration (patience)))
        :condition (at start (quiet))
        :effect (and (at start (singing)) (at end (not (singing))) (at end (sung)))))";

const PLAN: &str = "0: (shine) [20]\n1: (tune) [3]\n5: (sing) [6]\n";

fn studio(constraint: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    let problem = format!(
        "(define (problem song) (:domain studio)
          (:init (quiet) (= (patience) 7) (at 40 (not (quiet)))) (:goal (and (tuned) (sung)))
          (:constraints {constraint}))"
    );
    read(DOMAIN, &problem, PLAN)
}

const CONSTRAINTS: [&str; 10] = [
    "(and)",
    "(always (or (not (singing)) (lit)))",
    "(sometime (and (lit) (tuned)))",
    "(sometime-before (sung) (tuned))",
    "(sometime-after (singing) (sung))",
    "(at-most-once (singing))",
    "(within 14 (sung))",
    "(always-within 9 (singing) (sung))",
    "(hold-during 13 30 (not (singing)))",
    "(hold-after 15 (sung))",
];

#[test]
fn certificates_of_plans_with_trajectory_constraints_are_accepted() {
    let mut accepted = 0;
    for constraint in CONSTRAINTS {
        let (task, plan) = studio(constraint);
        let mut found = 0;
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                    continue;
                };
                let verdict = verify_answer_of(&answer.to_string(), &task, &plan);
                let what = format!("{constraint}, {guarantee:?}, {objective:?}");
                let verdict = verdict.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(verdict.assumes.is_empty(), "{what}");
                found += 1;
            }
        }
        assert!(found > 0, "{constraint} has no certificate");
        accepted += found;
    }
    println!("{accepted} certificates accepted");
    assert!(accepted >= 40, "{accepted}");
}

/// A certificate is accepted for a problem with another constraint only if the envelope is the
/// same.
#[test]
fn certificate_of_another_constraint_is_accepted_only_if_it_claims_the_same() {
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let mut refused = 0;
    let others = CONSTRAINTS.into_iter().chain([
        "(within 13 (sung))",
        "(always-within 8 (singing) (sung))",
        "(hold-during 12 30 (not (singing)))",
        "(hold-after 14 (sung))",
    ]);
    let others: Vec<&str> = others.collect();
    for constraint in CONSTRAINTS {
        let (task, plan) = studio(constraint);
        let genuine = answer(&task, &plan, goals.0, goals.1).expect("a box");
        let text = genuine.to_string();
        for other in others.iter().filter(|other| **other != constraint) {
            let (task, plan) = studio(other);
            if verify_answer_of(&text, &task, &plan).is_err() {
                refused += 1;
                continue;
            }
            let own = answer(&task, &plan, goals.0, goals.1).expect("a box");
            assert_eq!(claim(&own), claim(&genuine), "{constraint} for {other}");
        }
    }
    println!("{refused} refused");
    assert!(refused > 60, "{refused}");
}

/// The order required by the constraint is missing, or its bound is a little later.
#[test]
fn certificate_without_a_bound_of_a_constraint_is_refused() {
    for (constraint, number) in [
        ("(within 14 (sung))", "14"),
        ("(hold-after 15 (sung))", "15"),
    ] {
        let (task, plan) = studio(constraint);
        let genuine = answer(&task, &plan, Guarantee::Dynamic, Objective::Widths).expect("a box");
        let constraints = genuine["best"]["certificate"]["constraints"].as_array();
        let constraints = constraints.expect("a list");
        let is_it = |own: &&serde_json::Value| own["upper"] == json!({ "number": number });
        let place = constraints
            .iter()
            .position(|own| is_it(&own))
            .expect("a bound");
        for changed in [json!("none"), json!({ "number": "16" })] {
            let mut broken = genuine.clone();
            broken["best"]["certificate"]["constraints"][place]["upper"] = changed;
            let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
            assert!(verdict.is_err(), "{constraint}: {verdict:?}");
        }
    }
}

#[test]
fn constraint_that_reads_numbers_is_named_as_not_derivable() {
    let (task, plan) = studio("(and)");
    let genuine = answer(&task, &plan, Guarantee::Dynamic, Objective::Widths).expect("a box");
    let (task, plan) = studio("(sometime (>= (patience) 9))");
    match verify_answer_of(&genuine.to_string(), &task, &plan) {
        Err(AnswerError::NotDerivable(what)) => assert!(what.contains("patience"), "{what}"),
        verdict => panic!("{verdict:?}"),
    }
}

#[test]
fn mutated_certificates_with_constraints_are_refused_unless_they_claim_the_same() {
    let mut forger = Forger::new(0x1234_5678_9abc_def1);
    for constraint in CONSTRAINTS {
        let (task, plan) = studio(constraint);
        for guarantee in GUARANTEES {
            if let Some(answer) = answer(&task, &plan, guarantee, Objective::Widths) {
                let verify = |answer: &Value| verify_answer_of(&answer.to_string(), &task, &plan);
                let what = format!("{constraint}, {guarantee:?}");
                forger.attack((&answer, 60), &verify, &what);
            }
        }
    }
    assert!(forger.print_counts() > 800);
}
