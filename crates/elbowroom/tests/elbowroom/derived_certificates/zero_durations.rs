//! Over-all conditions that are vacuous because the action has duration 0.

use elbowroom::verify::{AnswerError, verify_answer_of};

use crate::derived_certificates::forgery::claim;
use crate::derived_certificates::{GUARANTEES, OBJECTIVES, answer, read};

/// Returns a domain for a plan with duration 0 of `look`.
fn domain(condition: &str) -> String {
    format!(
        "(define (domain d) (:requirements :adl :durative-actions :duration-inequalities :numeric-fluents)
           (:predicates (seen) (lit) (open) (done)) (:functions (n))
           (:durative-action look :parameters () :duration (and (>= ?duration 0) (<= ?duration 5))
             :condition (over all {condition}) :effect (at end (seen)))
           (:durative-action work :parameters () :duration (and (>= ?duration 1) (<= ?duration 5))
             :effect (and (at start (lit)) (at end (done)))))"
    )
}

const PROBLEM: &str =
    "(define (problem p) (:domain d) (:init (open) (= (n) 1)) (:goal (and (seen) (done))))";

const PLAN: &str = "0: (look) [0]\n1: (work) [2]";

#[test]
fn certificates_are_accepted_if_a_condition_over_all_limits_a_duration_to_zero() {
    let mut accepted = 0;
    for condition in ["(seen)", "(not (open))", "(>= (n) 3)"] {
        let (task, plan) = read(&domain(condition), PROBLEM, PLAN);
        // In another problem the same box is not the best one.
        let (other_task, other_plan) = read(&domain("(open)"), PROBLEM, PLAN);
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(own) = answer(&task, &plan, guarantee, objective) else {
                    continue;
                };
                let text = own.to_string();
                let what = format!("{condition}, {guarantee:?}, {objective:?}");
                let verified = verify_answer_of(&text, &task, &plan);
                let verified = verified.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(verified.assumes.is_empty(), "{what}");
                accepted += 1;
                let other = answer(&other_task, &other_plan, guarantee, objective);
                if other.is_some_and(|other| claim(&other) != claim(&own)) {
                    let verified = verify_answer_of(&text, &other_task, &other_plan);
                    assert!(verified.is_err(), "{what}: accepted for another domain");
                }
            }
        }
    }
    assert!(accepted >= 20, "{accepted}");
}

/// Instances of duration 0, so that their over-all condition is never read. Other instances make it
/// false, before and at the same time.
#[test]
fn certificates_are_accepted_if_earlier_instances_delete_a_vacuous_over_all_condition() {
    let mut accepted = 0;
    for effects in [
        "(at start (not (open)))",
        "(at end (not (open)))",
        "(and (at start (not (open))) (at end (not (open))))",
    ] {
        let domain = format!(
            "(define (domain d) (:requirements :typing :durative-actions) (:types thing)
               (:constants one other - thing) (:predicates (open))
               (:durative-action look :parameters (?x - thing) :duration (= ?duration 0)
                 :condition (over all (open)) :effect {effects}))"
        );
        for facts in ["", "(open)"] {
            let problem = format!("(define (problem p) (:domain d) (:init {facts}) (:goal (and)))");
            for steps in [
                "0: (look other) [0]\n1: (look one) [0]",
                "0: (look one) [0]",
            ] {
                let (task, plan) = read(&domain, &problem, steps);
                for guarantee in GUARANTEES {
                    for objective in OBJECTIVES {
                        let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                            continue;
                        };
                        let verdict = verify_answer_of(&answer.to_string(), &task, &plan);
                        accepted += usize::from(verdict.is_ok());
                        if let Err(AnswerError::Flaw(wrong)) = verdict {
                            panic!("{effects}, {facts}, {guarantee:?}, {objective:?}: {wrong}");
                        }
                    }
                }
            }
        }
    }
    assert!(accepted >= 50, "{accepted}");
}
