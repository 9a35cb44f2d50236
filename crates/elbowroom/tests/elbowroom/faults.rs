//! Failures that the plans of the cases afford, and the checks of their proofs.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use elbowroom::answers::faults::{Faults, FaultsAnswer, FaultsFinding, FaultsRequest, faults};
use elbowroom::answers::{EnvelopeRequest, NoObserver};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pddl::{self, Source};
use elbowroom::verify::{FaultsError, verify_faults};
use serde_json::Value;

fn answer(case: &str, count: Option<usize>, retries: Option<usize>) -> FaultsAnswer {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../cases")).join(case);
    let read = |file: &str| Source::new(file, fs::read_to_string(folder.join(file)).unwrap());
    let (problem, _) = pddl::read_problem(&read("domain.pddl"), &read("problem.pddl")).unwrap();
    let task = Arc::new(Task::new(problem));
    let (plan, _) = pddl::read_plan(&read("plan.plan"), &task).unwrap();
    answer_for(&task, plan, count, retries)
}

fn answer_for(
    task: &Arc<Task>,
    plan: TimeTriggeredPlan,
    count: Option<usize>,
    retries: Option<usize>,
) -> FaultsAnswer {
    let request = FaultsRequest {
        envelope: EnvelopeRequest::new(task, plan),
        faults: count,
        retries,
        recovery: [Rational::ZERO, Rational::ZERO],
    };
    faults(&request, &mut NoObserver).unwrap()
}

fn found(answer: &FaultsAnswer) -> &Faults {
    match &answer.finding {
        FaultsFinding::Faults(own) => own,
        other => panic!("{other:?}"),
    }
}

#[test]
fn slack_of_delivery_with_failures_is_that_worked_by_hand() {
    let answer = answer("delivery", None, None);
    let own = found(&answer);
    assert_eq!(
        (own.as_planned.at_least, own.as_planned.at_most),
        (Some(1), Some(1))
    );
    // Drives, pick and drop take 30 and have to end by 59.999, with three separations. The longest
    // repetition is the drive of 15, after a recovery of 0.001: 45 (1 + s) <= 59.995.
    let slacks: Vec<_> = own.table.iter().map(|row| row.slack.clone()).collect();
    assert_eq!(slacks, [Rational::new(999, 1000), Rational::new(333, 1000)]);
    assert!(own.table.iter().all(|row| row.exact));
    // If each action fails at most once, three failures take 28 at most, and four take 30.
    let own_retries = self::answer("delivery", None, Some(1));
    assert_eq!(found(&own_retries).as_planned.at_least, Some(3));
}

/// A tank that would overflow must not make the slack of all other durations 0.
#[test]
fn durations_that_cannot_be_longer_stay_as_planned() {
    let read = |text: &str| Source::new("text", text.to_owned());
    let domain = read(
        "(define (domain d)
           (:requirements :durative-actions :numeric-fluents :continuous-effects
             :timed-initial-literals)
           (:predicates (free) (full) (there) (open)) (:functions (tank))
           (:durative-action fill :parameters () :duration (= ?duration 2)
             :condition (and (at start (free)) (over all (<= (tank) 12)))
             :effect (and (at start (not (free))) (at end (full)) (increase (tank) (* #t 6))))
           (:durative-action drive :parameters () :duration (= ?duration 10)
             :condition (and (at start (full)) (at end (open)))
             :effect (and (at start (not (full))) (at end (there)))))",
    );
    let problem = read(
        "(define (problem p) (:domain d) (:init (free) (open) (= (tank) 0) (at 34 (not (open))))
           (:goal (there)))",
    );
    let (problem, _) = pddl::read_problem(&domain, &problem).unwrap();
    let task = Arc::new(Task::new(problem));
    let plan = read("0: (fill) [2]\n2.001: (drive) [10]\n");
    let (plan, _) = pddl::read_plan(&plan, &task).unwrap();
    let answer = answer_for(&task, plan, None, None);
    let own = found(&answer);
    let filling = own
        .box_with_faults
        .iter()
        .find(|row| row.action.as_deref() == Some("(fill)"));
    assert_eq!(own.not_longer, [filling.unwrap().name.clone()]);
    assert_eq!(filling.unwrap().upper, Rational::from(2));
    assert!(
        own.table.iter().all(|row| row.slack.is_positive()),
        "{own:?}"
    );
    assert!(own.table.len() >= 2, "{own:?}");
}

#[test]
fn proofs_about_failures_are_accepted_and_forged_ones_rejected() {
    let mut affordable = 0;
    let mut refuted = 0;
    for case in ["crossing", "delivery", "match", "paintshop", "battery"] {
        for count in 0..=3 {
            let answer = answer(case, Some(count), None);
            let own = found(&answer);
            if own.proof.is_none() {
                continue;
            }
            let text = serde_json::to_string(&answer).unwrap();
            let verified = verify_faults(&text).unwrap();
            let is_affordable = own.as_planned.at_least >= Some(count);
            assert_eq!(verified.is_affordable, is_affordable, "{case} {count}");
            if is_affordable {
                affordable += 1;
            } else {
                refuted += 1;
            }
            check_forgeries(&text, is_affordable);
        }
    }
    assert!(affordable >= 5 && refuted >= 2, "{affordable} {refuted}");
}

/// Changes a proof so that it no longer holds.
fn check_forgeries(text: &str, is_affordable: bool) {
    let document: Value = serde_json::from_str(text).unwrap();
    let is_refused = |forged: &Value| {
        let verdict = verify_faults(&forged.to_string());
        assert!(matches!(verdict, Err(FaultsError::Flaw(_))), "{forged}");
    };
    if is_affordable {
        // Each action ends no earlier than its start and its greatest duration.
        for (index, attempt) in entries(&document["proof"]["attempts"]).iter().enumerate() {
            if attempt["start"] == 0 || attempt["upper"].is_null() {
                continue;
            }
            let mut forged = document.clone();
            let upper = &mut forged["proof"]["attempts"][index]["upper"];
            let longer = exact(upper) + Rational::from(1_000_000);
            *upper = serde_json::json!({ "exact": longer.to_string() });
            let end = usize::try_from(attempt["end"].as_u64().unwrap()).unwrap();
            if !document["proof"]["latest"][end][0].is_null() {
                is_refused(&forged);
            }
        }
        let mut forged = document.clone();
        let count = forged["proof"]["faults"].as_u64().unwrap();
        forged["proof"]["faults"] = (count + 1).into();
        is_refused(&forged);
    } else {
        let mut forged = document.clone();
        for attempt in forged["proof"]["attempts"].as_array_mut().unwrap() {
            attempt["retries"] = 0.into();
        }
        is_refused(&forged);
        let mut forged = document.clone();
        for requirement in forged["proof"]["requirements"].as_array_mut().unwrap() {
            if requirement["from"] == 0 || exact(&requirement["bound"]).is_positive() {
                requirement["bound"] = serde_json::json!({ "exact": "1000000" });
            }
        }
        for attempt in forged["proof"]["attempts"].as_array_mut().unwrap() {
            if attempt["start"] == 0 {
                attempt["lower"] = serde_json::json!({ "exact": "1000000" });
                attempt["upper"] = attempt["lower"].clone();
            }
        }
        is_refused(&forged);
    }
}

fn entries(value: &Value) -> &[Value] {
    value.as_array().unwrap()
}

fn exact(value: &Value) -> Rational {
    value["exact"].as_str().unwrap().parse().unwrap()
}
