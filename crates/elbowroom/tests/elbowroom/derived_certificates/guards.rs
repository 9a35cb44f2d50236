//! Certificates of plans whose conditional effects depend on numbers that vary.

use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, envelope};
use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::execution::run::TimeoutRule;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::verify::verify_answer_of;
use serde_json::Value;

use super::forgery::{Forger, tightened};
use super::{GUARANTEES, OBJECTIVES, answer, read};

/// Watering only has an effect if the tank was filled for long enough; filling for too long floods
/// the cellar.
const DOMAIN: &str = "
    (define (domain garden)
      (:requirements :durative-actions :fluents :conditional-effects :negative-preconditions)
      (:predicates (ready) (watered) (flooded) (noted))
      (:functions (level) (log))
      (:durative-action fill :parameters () :duration (= ?duration 10) :condition ()
        :effect (and (at end (increase (level) (* 2 ?duration))) (at end (ready))
          (when (at end (> ?duration 16)) (at end (flooded)))))
      (:durative-action water :parameters () :duration (= ?duration 4) :condition (at start (ready))
        :effect (and (when (at start (>= (level) 12)) (at end (watered)))
          (when (at end (>= (level) 30)) (at end (noted))))))";

const PLAN: &str = "0: (fill) [10]\n11: (water) [4]\n";

fn problem(goal: &str) -> String {
    format!(
        "(define (problem summer) (:domain garden)
           (:init (= (level) 0) (= (log) 0)) (:goal (and {goal})))"
    )
}

/// Goals for which the conditions of the plan's effects must be as in the plan, and one for which
/// some of them must.
const GOALS: [&str; 3] = [
    "(watered) (not (flooded)) (not (noted))",
    "(watered) (not (flooded))",
    "(ready)",
];

#[test]
fn certificates_of_plans_with_conditional_effects_on_numbers_that_vary_are_accepted() {
    let (mut accepted, mut refused) = (0, Vec::new());
    for goal in GOALS {
        let (task, plan) = read(DOMAIN, &problem(goal), PLAN);
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                    continue;
                };
                match verify_answer_of(&answer.to_string(), &task, &plan) {
                    Ok(verdict) => {
                        assert!(verdict.assumes.is_empty(), "{goal}");
                        accepted += 1;
                    }
                    Err(wrong) => {
                        refused.push(format!("{goal}, {guarantee:?}, {objective:?}: {wrong}"));
                    }
                }
            }
        }
    }
    println!("{accepted} certificates accepted, refused: {refused:#?}");
    // A condition that no goal needs may change inside a valid box.
    let is_free =
        |own: &String| own.starts_with("(ready)") || own.starts_with("(watered) (not (flooded)),");
    assert!(refused.iter().all(is_free), "{refused:#?}");
    assert!(accepted >= 6, "{accepted}");
}

/// Returns `true` if the box of an answer is inside the envelope, by the box check.
fn is_inside(task: &Arc<Task>, plan: &TimeTriggeredPlan, answer: &Value) -> bool {
    let parameters = answer["parameters"].as_array().expect("a list");
    let interval = |own: &Value| {
        let text = |value: &Value| value.as_str().expect("a text").to_owned();
        let [name, lower, upper] =
            [&own["name"], &own["lower"]["exact"], &own["upper"]["exact"]].map(text);
        format!("{name}=[{lower}, {upper}]")
    };
    let intervals: Vec<String> = parameters.iter().map(interval).collect();
    let mut request = EnvelopeRequest::new(task, plan.clone());
    request.guarantee = Guarantee::Dynamic;
    request.timeout = TimeoutRule::Off;
    request.contains = Some(intervals.join(" "));
    let outcome = envelope(&request, &mut NoObserver).expect("an answer");
    matches!(outcome.answer.finding, EnvelopeFinding::Inside { .. })
}

#[test]
fn certificate_for_another_threshold_is_accepted_only_if_its_claim_is_true() {
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let (task, plan) = read(DOMAIN, &problem(GOALS[0]), PLAN);
    let genuine = answer(&task, &plan, goals.0, goals.1).expect("a box");
    let text = genuine.to_string();
    verify_answer_of(&text, &task, &plan).expect("it is that of this plan");
    let mut refused = 0;
    for (old, new) in [
        ("(>= (level) 12)", "(>= (level) 13)"),
        ("(>= (level) 12)", "(>= (level) 11)"),
        ("(>= (level) 12)", "(> (level) 12)"),
        ("(> ?duration 16)", "(> ?duration 15)"),
        ("(> ?duration 16)", "(> ?duration 14)"),
        ("(>= (level) 30)", "(>= (level) 28)"),
        ("(* 2 ?duration)", "(* 3 ?duration)"),
        ("(not (noted))", "(ready)"),
        ("(not (flooded))", "(ready)"),
    ] {
        let (domain, goal) = (
            DOMAIN.replace(old, new),
            problem(GOALS[0]).replace(old, new),
        );
        assert!(domain != DOMAIN || goal != problem(GOALS[0]), "{old}");
        let (task, plan) = read(&domain, &goal, PLAN);
        if verify_answer_of(&text, &task, &plan).is_err() {
            refused += 1;
            continue;
        }
        // The search may have ended with another box, but the claim is true.
        let own = answer(&task, &plan, goals.0, goals.1).expect("a box");
        let number = |answer: &Value, name: &str| -> Rational {
            let exact = answer["best"][name]["exact"].as_str().expect("a number");
            exact.parse().expect("exact")
        };
        let bound = number(&genuine, "bound");
        assert!(number(&own, "value") <= bound, "{old} -> {new}");
        assert!(is_inside(&task, &plan, &genuine), "{old} -> {new}");
    }
    println!("{refused} refused");
    assert!(refused >= 4, "{refused}");
}

/// An inequality that holds only while a condition of an effect holds is rejected if the plan is
/// also valid without that condition.
#[test]
fn inequality_about_a_condition_that_the_goal_does_not_need_is_refused() {
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let (task, plan) = read(DOMAIN, &problem(GOALS[0]), PLAN);
    let genuine = answer(&task, &plan, goals.0, goals.1).expect("a box");
    let (task, plan) = read(DOMAIN, &problem("(ready)"), PLAN);
    let verdict = verify_answer_of(&genuine.to_string(), &task, &plan);
    assert!(verdict.is_err(), "{verdict:?}");
    let (task, plan) = read(DOMAIN, &problem(GOALS[0]), PLAN);
    let forged = tightened(&genuine);
    for (index, broken) in forged.iter().enumerate() {
        let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
        assert!(verdict.is_err(), "inequality {index}");
    }
    assert!(!forged.is_empty());
}

#[test]
fn mutated_certificates_with_such_effects_are_refused_unless_they_claim_the_same() {
    let mut forger = Forger::new(0x0fed_cba9_8765_4321);
    for goal in GOALS {
        let (task, plan) = read(DOMAIN, &problem(goal), PLAN);
        for guarantee in GUARANTEES {
            if let Some(answer) = answer(&task, &plan, guarantee, Objective::Widths) {
                let verify = |answer: &Value| verify_answer_of(&answer.to_string(), &task, &plan);
                forger.attack((&answer, 100), &verify, &format!("{goal}, {guarantee:?}"));
            }
        }
    }
    assert!(forger.print_counts() > 300);
}
