//! Certificates checked against the network and the conditions that the checker derives from
//! domain, problem and plan: correct ones are accepted, and modified ones are rejected.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

mod chosen_durations;
mod forgery;
mod guards;
mod labels;
mod likely_boxes;
mod networks;
mod numbers_that_change;
mod trajectory_constraints;
mod windows;
mod zero_durations;

use crate::shared;
use std::sync::Arc;

use crate::shared::own::case;
use elbowroom::AnyPlan;
use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeRequest, envelope};
use elbowroom::envelope::{BestSettings, Guarantee, Method, Objective};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::pddl::{self, read_plan};
use elbowroom::verify::{AnswerError, Certificate, verify_answer_of, with_sums};
use forgery::{Forger, claim, tightened};
use serde_json::{Value, json};

const GUARANTEES: [Guarantee; 3] = [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong];
const OBJECTIVES: [Objective; 3] = [Objective::LeastSlack, Objective::Widths, Objective::Volume];

/// Cases whose plans are valid in every schedule that keeps their orders.
const OF_ORDERS: [&str; 4] = ["delivery", "hatchery", "lamp", "match"];

fn answer(
    task: &Arc<Task>,
    plan: &TimeTriggeredPlan,
    guarantee: Guarantee,
    objective: Objective,
) -> Option<Value> {
    answer_for(task, plan, (guarantee, objective), &[])
}

/// Returns the answer with these quantities as parameters; by default the durations that the domain
/// fixes.
fn answer_for(
    task: &Arc<Task>,
    plan: &(impl Clone + Into<AnyPlan>),
    (guarantee, objective): (Guarantee, Objective),
    vary: &[&str],
) -> Option<Value> {
    let mut request = request(task, plan, (guarantee, objective));
    let specifications = vary.iter().map(|own| own.parse().expect("a specification"));
    request.vary = specifications.collect();
    answered(&request)
}

fn request(
    task: &Arc<Task>,
    plan: &(impl Clone + Into<AnyPlan>),
    (guarantee, objective): (Guarantee, Objective),
) -> EnvelopeRequest {
    let mut request = EnvelopeRequest::new(task, plan.clone());
    request.guarantee = guarantee;
    request.search.method = Some(Method::Best);
    request.search.best = BestSettings {
        objective,
        ..BestSettings::default()
    };
    request
}

/// Returns the answer, if it has a certificate.
fn answered(request: &EnvelopeRequest) -> Option<Value> {
    let outcome = envelope(request, &mut NoObserver).ok()?;
    let answer = serde_json::to_value(&outcome.answer).expect("a document");
    let certificate = answer.pointer("/best/certificate");
    certificate.is_some_and(Value::is_object).then_some(answer)
}

fn timed(name: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    match case(name) {
        (task, AnyPlan::TimeTriggered(plan)) => (task, plan),
        (_, AnyPlan::Stn(_)) => panic!("a plan with fixed times"),
    }
}

fn read(domain: &str, problem: &str, plan: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    readable(domain, problem, plan).expect("no mistakes")
}

/// Returns the task and the plan, or `None` if the texts have mistakes.
fn readable(domain: &str, problem: &str, plan: &str) -> Option<(Arc<Task>, TimeTriggeredPlan)> {
    let source = |name: &str, text: &str| pddl::Source::new(name, text);
    let read = pddl::read_problem(&source("domain", domain), &source("problem", problem));
    let task = Arc::new(Task::new(read.ok()?.0));
    let plan = read_plan(&source("plan", plan), &task);
    Some((task, plan.ok()?.0))
}

#[test]
fn true_certificates_of_plans_that_need_orders_alone_are_accepted() {
    let mut accepted = 0;
    for name in OF_ORDERS {
        let (task, plan) = timed(name);
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                    continue;
                };
                let verified = verify_answer_of(&answer.to_string(), &task, &plan);
                let what = format!("{name}, {guarantee:?}, {objective:?}");
                let verified = verified.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(
                    verified.assumes.is_empty(),
                    "{what}: {:?}",
                    verified.assumes
                );
                accepted += 1;
            }
        }
    }
    println!("{accepted} certificates accepted");
    assert!(accepted >= 30, "{accepted}");
}

/// Returns problems whose conditions read numbers that depend on times and durations.
fn of_numbers() -> Vec<(&'static str, (Arc<Task>, TimeTriggeredPlan))> {
    let own = numbers_that_change::ALL.iter();
    let own = own.map(|(name, (domain, problem, plan))| (*name, read(domain, problem, plan)));
    let cases = ["battery", "tank"].map(|name| (name, timed(name)));
    own.chain(cases).collect()
}

#[test]
fn true_certificates_of_plans_with_numbers_that_vary_are_accepted() {
    let (mut accepted, mut stated) = (0, 0);
    for (name, (task, plan)) in of_numbers() {
        let mut found = 0;
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                    continue;
                };
                let verified = verify_answer_of(&answer.to_string(), &task, &plan);
                let what = format!("{name}, {guarantee:?}, {objective:?}");
                let verified = verified.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(verified.assumes.is_empty(), "{what}");
                assert_eq!(verified.assumed, 0, "{what}");
                stated += verified.from_conditions;
                found += 1;
            }
        }
        assert!(found > 0 || name == "tank", "{name} has no certificate");
        accepted += found;
    }
    println!("{accepted} certificates accepted, with {stated} inequalities from conditions");
    assert!(accepted >= 30 && stated >= 30, "{accepted}, {stated}");
}

#[test]
fn certificate_about_an_initial_value_is_accepted_for_that_value_alone() {
    let (domain, problem, plan) = numbers_that_change::TAXI;
    let (task, own) = read(domain, problem, plan);
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let vary = ["durations", "initial (fuel)", "initial (dirt)"];
    let answer = answer_for(&task, &own, goals, &vary).expect("a box");
    let verified = verify_answer_of(&answer.to_string(), &task, &own);
    assert!(
        verified
            .expect("it is that of this plan")
            .assumes
            .is_empty()
    );
    // The same with another fluent, or another value.
    let text = answer.to_string();
    let other = text.replace("initial (fuel)", "initial (money)");
    let verdict = verify_answer_of(&other, &task, &own);
    assert!(matches!(verdict, Err(AnswerError::Flaw(_))), "{verdict:?}");
    let fuller = problem.replace("(= (fuel) 40)", "(= (fuel) 41)");
    let (fuller, own) = read(domain, &fuller, plan);
    let verdict = verify_answer_of(&text, &fuller, &own);
    assert!(matches!(verdict, Err(AnswerError::Flaw(_))), "{verdict:?}");
}

#[test]
fn certificate_about_a_constant_of_an_action_is_not_derivable() {
    let (domain, problem, plan) = numbers_that_change::LIFT;
    let (task, own) = read(domain, problem, plan);
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let answer = answer_for(&task, &own, goals, &["constant weigh load"]).expect("a box");
    let verdict = verify_answer_of(&answer.to_string(), &task, &own);
    assert!(
        matches!(verdict, Err(AnswerError::NotDerivable(_))),
        "{verdict:?}"
    );
}

#[test]
fn certificate_that_states_another_inequality_is_not_accepted() {
    let mut count = 0;
    for (name, (task, plan)) in of_numbers() {
        let Some(answer) = answer(&task, &plan, Guarantee::Dynamic, Objective::Widths) else {
            continue;
        };
        for (index, broken) in tightened(&answer).iter().enumerate() {
            let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
            assert!(verdict.is_err(), "{name}, inequality {index}");
            count += 1;
        }
    }
    assert!(count >= 6, "{count}");
}

#[test]
fn certificate_without_its_conditions_or_of_another_decimal_is_not_accepted() {
    let mut count = 0;
    for (name, (task, plan)) in of_numbers() {
        let Some(answer) = answer(&task, &plan, Guarantee::Dynamic, Objective::LeastSlack) else {
            continue;
        };
        count += 1;
        let mut decimal = answer.clone();
        let place = "/parameters/0/nominal/decimal";
        *decimal.pointer_mut(place).expect("a number") = json!(0.125);
        let mut swapped = answer.clone();
        let labels = swapped.pointer_mut("/best/certificate/points");
        labels
            .and_then(Value::as_array_mut)
            .expect("a list")
            .swap(1, 2);
        for broken in [decimal, swapped] {
            let verdict = verify_answer_of(&broken.to_string(), &task, &plan);
            assert!(
                matches!(verdict, Err(AnswerError::Flaw(_))),
                "{name}: {verdict:?}"
            );
        }
        // All proofs about conditions may be missing if the checker can refute all failures itself.
        let mut bare = answer.clone();
        bare["best"]["certificate"]["sound"]["conditions"] = json!([]);
        let certificate: Certificate =
            serde_json::from_value(bare["best"]["certificate"].clone()).expect("readable");
        bare["best"]["certificate"] = json!(with_sums(certificate).expect("a certificate"));
        if let Ok(verified) = verify_answer_of(&bare.to_string(), &task, &plan) {
            assert!(verified.assumes.is_empty(), "{name}");
            assert_eq!(claim(&bare), claim(&answer), "{name}");
        }
    }
    assert!(count >= 5, "{count}");
}

/// If the checker accepts a certificate for a modified problem, the answer for the modified problem
/// has the same claim.
#[test]
fn certificate_of_a_changed_problem_is_accepted_only_if_it_claims_the_same() {
    let (mut count, mut same) = (0, 0);
    for (name, (domain, problem, plan)) in numbers_that_change::ALL {
        let (task, own) = read(domain, problem, plan);
        let (guarantee, objective) = (Guarantee::Dynamic, Objective::LeastSlack);
        let genuine = answer(&task, &own, guarantee, objective).expect("a box");
        let text = genuine.to_string();
        for (old, new) in numbers_that_change::CHANGES {
            for place in 0..2 {
                let source = [domain, problem][place];
                for (at, _) in source.match_indices(old) {
                    let changed = format!("{}{new}{}", &source[..at], &source[at + old.len()..]);
                    let texts = if place == 0 {
                        (changed.as_str(), problem)
                    } else {
                        (domain, changed.as_str())
                    };
                    let Some((task, own)) = readable(texts.0, texts.1, plan) else {
                        continue;
                    };
                    count += 1;
                    if verify_answer_of(&text, &task, &own).is_err() {
                        continue;
                    }
                    same += 1;
                    let other = answer(&task, &own, guarantee, objective);
                    let other = other.unwrap_or_else(|| panic!("{name}: no box for {changed}"));
                    assert_eq!(claim(&other), claim(&genuine), "{name}: {changed}");
                }
            }
        }
    }
    println!("{count} changed problems, of which {same} have the same envelope");
    assert!(count > 100 && same < count, "{count}, {same}");
}

const DOMAIN: &str = "
    (define (domain errands)
      (:requirements :durative-actions :timed-initial-literals :negative-preconditions)
      (:predicates (open) (lit) (made) (sold) (kept))
      (:durative-action light :parameters () :duration (= ?duration 9) :condition (and)
        :effect (and (at start (lit)) (at end (not (lit)))))
      (:durative-action make :parameters () :duration (= ?duration 4)
        :condition (over all (lit)) :effect (at end (made)))
      (:durative-action keep :parameters () :duration (= ?duration 4)
        :condition (over all (lit)) :effect (at end (kept)))
      (:durative-action sell :parameters () :duration (= ?duration 3)
        :condition (and (at start (made)) (over all (open))) :effect (at end (sold))))";

const PROBLEM: &str = "
    (define (problem day) (:domain errands)
      (:init (open) (at 20 (not (open)))) (:goal (and (sold) (kept))))";

const PLAN: &str = "0: (light) [9]\n1: (make) [4]\n2: (keep) [4]\n6: (sell) [3]\n";

/// Unread numbers that depend on durations or change continuously, a start that reads its planned duration, and a
/// duration bound that another action changes.
const WORKSHOP: &str = "
    (define (domain workshop)
      (:requirements :durative-actions :fluents :continuous-effects)
      (:predicates (open) (cut) (glued))
      (:functions (worked) (used) (worn) (reserved) (drying))
      (:durative-action unlock :parameters () :duration (= ?duration 2) :condition (and)
        :effect (and (at end (open)) (at end (assign (drying) 6)) (at end (increase (worked) ?duration))))
      (:durative-action cut :parameters () :duration (= ?duration 4)
        :condition (and (at start (open)) (at start (<= (reserved) 5)))
        :effect (and (at start (increase (reserved) ?duration)) (at end (cut))
          (at end (increase (worked) (* 2 ?duration))) (increase (used) (* #t 3))))
      (:durative-action glue :parameters () :duration (= ?duration (drying))
        :condition (and (at start (cut)) (over all (open)))
        :effect (and (at end (glued)) (at end (assign (worn) (+ 1 ?duration))))))";

const WORKSHOP_PROBLEM: &str = "
    (define (problem shelf) (:domain workshop)
      (:init (= (worked) 0) (= (used) 0) (= (worn) 0) (= (reserved) 0) (= (drying) 9)
        (at 40 (not (open))))
      (:goal (and (glued) (<= (reserved) 4))))";

const WORKSHOP_PLAN: &str = "0: (unlock) [2]\n3: (cut) [4]\n8: (glue) [6]\n";

#[test]
fn certificate_with_numbers_that_nothing_reads_is_accepted() {
    let (task, plan) = read(WORKSHOP, WORKSHOP_PROBLEM, WORKSHOP_PLAN);
    let mut accepted = 0;
    for guarantee in GUARANTEES {
        for objective in OBJECTIVES {
            let Some(answer) = answer(&task, &plan, guarantee, objective) else {
                continue;
            };
            let verified = verify_answer_of(&answer.to_string(), &task, &plan);
            let what = format!("{guarantee:?}, {objective:?}");
            let verified = verified.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
            assert!(verified.assumes.is_empty(), "{what}");
            accepted += 1;
        }
    }
    assert!(accepted >= 6, "{accepted}");
}

#[test]
fn certificate_is_not_accepted_once_such_a_number_limits_the_box() {
    let (task, plan) = read(WORKSHOP, WORKSHOP_PROBLEM, WORKSHOP_PLAN);
    let (guarantee, objective) = (Guarantee::Dynamic, Objective::LeastSlack);
    let answer = answer(&task, &plan, guarantee, objective).expect("a box");
    let text = answer.to_string();
    verify_answer_of(&text, &task, &plan).expect("nothing reads it");
    let mut refused = 0;
    for number in ["worked", "used", "worn"] {
        let goal = format!("(glued) (<= ({number}) 10)");
        let condition = format!("(at end (<= ({number}) 10))");
        let others = [
            (
                WORKSHOP.to_owned(),
                WORKSHOP_PROBLEM.replace("(glued)", &goal),
            ),
            (
                WORKSHOP.replace(
                    "(over all (open))",
                    &format!("(over all (<= ({number}) 99))"),
                ),
                WORKSHOP_PROBLEM.to_owned(),
            ),
            (
                WORKSHOP.replace("(at start (cut))", &format!("(at start (cut)) {condition}")),
                WORKSHOP_PROBLEM.to_owned(),
            ),
        ];
        for (domain, problem) in others {
            let (task, plan) = read(&domain, &problem, WORKSHOP_PLAN);
            if verify_answer_of(&text, &task, &plan).is_err() {
                refused += 1;
                continue;
            }
            let other = answer_for(&task, &plan, (guarantee, objective), &[]).expect("a box");
            assert_eq!(claim(&other), claim(&answer), "{domain}\n{problem}");
        }
    }
    assert!(refused >= 3, "{refused}");
    // The quotient is undefined for some duration.
    let quotient = WORKSHOP.replace("(+ 1 ?duration)", "(/ 1 ?duration)");
    let (task, plan) = read(&quotient, WORKSHOP_PROBLEM, WORKSHOP_PLAN);
    let verdict = verify_answer_of(&text, &task, &plan);
    assert!(
        matches!(verdict, Err(AnswerError::NotDerivable(_))),
        "{verdict:?}"
    );
}

#[test]
fn certificate_of_another_plan_or_problem_is_refused() {
    let (task, plan) = read(DOMAIN, PROBLEM, PLAN);
    let answer = answer(&task, &plan, Guarantee::Dynamic, Objective::Widths).expect("a box");
    let text = answer.to_string();
    verify_answer_of(&text, &task, &plan).expect("it is that of this plan");
    let others = [
        // Actions of equal durations are exchanged.
        (
            DOMAIN.to_owned(),
            PROBLEM.to_owned(),
            PLAN.replace("1: (make)", "1: (keep)")
                .replace("2: (keep)", "2: (make)"),
        ),
        // Another duration, another time, an additional action.
        (
            DOMAIN.replace("duration 3)", "duration 2)"),
            PROBLEM.to_owned(),
            PLAN.replace("[3]", "[2]"),
        ),
        (
            DOMAIN.to_owned(),
            PROBLEM.to_owned(),
            format!("{PLAN}10: (keep) [4]\n"),
        ),
        // The shop closes earlier, and not at all.
        (
            DOMAIN.to_owned(),
            PROBLEM.replace("(at 20", "(at 18"),
            PLAN.to_owned(),
        ),
        (
            DOMAIN.to_owned(),
            PROBLEM.replace("(at 20 (not (open)))", ""),
            PLAN.to_owned(),
        ),
        // An additional condition: selling needs light.
        (
            DOMAIN.replace("(over all (open))", "(over all (open)) (over all (lit))"),
            PROBLEM.to_owned(),
            PLAN.to_owned(),
        ),
        // Interfering actions that the network does not separate.
        (
            DOMAIN.replace(
                "(at end (kept))",
                "(and (at end (kept)) (at start (not (sold))))",
            ),
            PROBLEM.to_owned(),
            PLAN.to_owned(),
        ),
        // The domain leaves a choice of durations, or allows another one.
        (
            DOMAIN.replace("(= ?duration 3)", "(and (>= ?duration 3) (<= ?duration 5))"),
            PROBLEM.replace("day", "night"),
            PLAN.to_owned(),
        ),
    ];
    for (domain, problem, plan) in others {
        let (task, plan) = read(&domain, &problem, &plan);
        let verdict = verify_answer_of(&text, &task, &plan);
        assert!(verdict.is_err(), "{domain}\n{problem}");
    }
}

#[test]
fn mutated_certificates_are_refused_unless_they_claim_the_same() {
    let mut forger = Forger::new(0x9e37_79b9_7f4a_7c15);
    let mut subjects = OF_ORDERS.map(timed).to_vec();
    subjects.push(read(DOMAIN, PROBLEM, PLAN));
    subjects.push(read(WORKSHOP, WORKSHOP_PROBLEM, WORKSHOP_PLAN));
    subjects.extend(of_numbers().into_iter().map(|(_, own)| own));
    for (task, plan) in &subjects {
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                if let Some(answer) = answer(task, plan, guarantee, objective) {
                    let what = format!("{guarantee:?}, {objective:?}");
                    let verify = |answer: &Value| verify_answer_of(&answer.to_string(), task, plan);
                    forger.attack((&answer, 100), &verify, &what);
                }
            }
        }
    }
    assert!(forger.print_counts() > 5_000);
}
