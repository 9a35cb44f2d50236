//! Windows of timed initials whose times vary, and boxes whose intervals are symmetric around the
//! nominal value.

use super::*;

const DOMAIN: &str = "(define (domain harbour)
  (:requirements :strips :durative-actions :duration-inequalities :timed-initial-literals)
  (:predicates (tide) (aboard) (moored))
  (:durative-action board :parameters () :duration (and (>= ?duration 2) (<= ?duration 9))
    :condition (and) :effect (at end (aboard)))
  (:durative-action sail :parameters () :duration (= ?duration 6)
    :condition (and (at start (aboard)) (over all (tide))) :effect (at end (moored))))";

const PROBLEM: &str = "(define (problem spring) (:domain harbour)
  (:init (at 1 (tide)) (at 20 (not (tide))) (at 30 (tide)))
  (:goal (moored)))";

const PLAN: &str = "0: (board) [2]\n2.001: (sail) [6]\n";

#[test]
fn certificates_are_accepted_if_the_times_of_a_window_vary() {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    for guarantee in GUARANTEES {
        for objective in OBJECTIVES {
            let vary = ["durations", "deadline (tide)"];
            let answer = answer_for(&task, &plan, (guarantee, objective), &vary).expect("a box");
            let verified = verify_answer_of(&answer.to_string(), &task, &plan);
            verified.unwrap_or_else(|wrong| panic!("{guarantee:?}, {objective:?}: {wrong}"));
        }
    }
}

#[test]
fn certificate_whose_window_is_kept_open_for_longer_than_epsilon_is_refused() {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    let wanted = (Guarantee::Dynamic, Objective::Widths);
    let mut answer = answer_for(&task, &plan, wanted, &["deadline (tide)"]).expect("a box");
    let constraints = &mut answer["best"]["certificate"]["constraints"];
    let constraints = constraints.as_array_mut().expect("a list");
    let mut own = constraints[0].clone();
    own["from"] = json!(5);
    own["to"] = json!(6);
    own["lower"] = json!({"number": "1/100"});
    own["upper"] = json!("none");
    own["observed"] = json!(false);
    constraints.push(own);
    assert!(verify_answer_of(&answer.to_string(), &task, &plan).is_err());
}

#[test]
fn certificates_of_symmetric_boxes_are_accepted() {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    for guarantee in GUARANTEES {
        let mut request = EnvelopeRequest::new(&task, plan.clone());
        request.guarantee = guarantee;
        request.search.method = Some(Method::Best);
        request.search.best = BestSettings {
            symmetric: true,
            ..BestSettings::default()
        };
        let outcome = envelope(&request, &mut NoObserver).expect("a box");
        let answer = serde_json::to_value(&outcome.answer).expect("a document");
        let verified = verify_answer_of(&answer.to_string(), &task, &plan);
        verified.unwrap_or_else(|wrong| panic!("{guarantee:?}: {wrong}"));
    }
}
