//! Weak boxes of plans with durations that the executor could choose, and that the network keeps as
//! planned.

use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::verify::{AnswerError, verify_answer_of};
use serde_json::{Value, json};

use super::forgery::Forger;
use super::{OBJECTIVES, answer_for, read};

/// Action whose over-all condition never holds: it is only possible with duration 0.
const BLINK: [&str; 3] = [
    "(define (domain blinks) (:requirements :durative-actions :duration-inequalities)
      (:predicates (lit) (seen) (made))
      (:durative-action blink :parameters () :duration (>= ?duration 0)
        :condition (over all (lit)) :effect (at end (seen)))
      (:durative-action make :parameters () :duration (= ?duration 4)
        :condition (at start (seen)) :effect (at end (made))))",
    "(define (problem blink) (:domain blinks) (:init) (:goal (made)))",
    "0: (blink) [0]\n0.001: (make) [4]\n",
];

/// Effect that depends on a duration, at the start or at the end, and a condition that reads it.
const POUR: [&str; 3] = [
    "(define (domain pours) (:requirements :durative-actions :duration-inequalities :fluents)
      (:predicates (poured) (made)) (:functions (amount))
      (:durative-action pour :parameters ()
        :duration (and (>= ?duration 2) (<= ?duration 8)) :condition (and)
        :effect (and (at end (increase (amount) ?duration)) (at end (poured))))
      (:durative-action make :parameters () :duration (= ?duration 4)
        :condition (and (at start (poured)) (at start (>= (amount) 3)))
        :effect (at end (made))))",
    "(define (problem pour) (:domain pours) (:init (= (amount) 0) (at 40 (not (poured))))
      (:goal (made)))",
    "0: (pour) [5]\n5.001: (make) [4]\n",
];

#[test]
fn duration_kept_as_planned_is_accepted_unless_a_proof_depends_on_it() {
    let mut forger = Forger::new(0x2545_f491_4f6c_dd1d);
    let early = POUR.map(|text| text.replace("(at end (increase", "(at start (increase"));
    let early = [&*early[0], &*early[1], &*early[2]];
    let (mut accepted, mut undecided) = (0, 0);
    for [domain, problem, plan] in [BLINK, POUR, early] {
        let (task, own) = read(domain, problem, plan);
        for objective in OBJECTIVES {
            let goals = (Guarantee::Weak, objective);
            let answer = answer_for(&task, &own, goals, &["duration make"]).expect("a box");
            let verify = |answer: &Value| verify_answer_of(&answer.to_string(), &task, &own);
            match verify(&answer) {
                Ok(verified) => {
                    assert!(verified.assumes.is_empty(), "{domain}");
                    accepted += 1;
                    forger.attack((&answer, 200), &verify, domain);
                }
                Err(AnswerError::NotDerivable(_)) => undecided += 1,
                Err(wrong) => panic!("{wrong}: {domain}"),
            }
        }
    }
    println!("{accepted} accepted, {undecided} not derivable");
    assert!(accepted >= 6, "{accepted}");
    assert!(forger.print_counts() > 1_000);
}

#[test]
fn duration_kept_at_another_number_is_not_accepted() {
    let [domain, problem, plan] = POUR;
    let (task, own) = read(domain, problem, plan);
    let goals = (Guarantee::Weak, Objective::LeastSlack);
    let mut answer = answer_for(&task, &own, goals, &["duration make"]).expect("a box");
    let constraints = answer.pointer_mut("/best/certificate/constraints");
    let constraints = constraints.and_then(Value::as_array_mut).expect("a list");
    let planned = json!({ "number": "5" });
    let mut changed = 0;
    for constraint in constraints.iter_mut().filter(|own| own["lower"] == planned) {
        constraint["lower"] = json!({ "number": "4" });
        constraint["upper"] = json!({ "number": "4" });
        changed += 1;
    }
    assert_eq!(changed, 1);
    assert!(verify_answer_of(&answer.to_string(), &task, &own).is_err());
}
