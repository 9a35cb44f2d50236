//! Certificates checked against plan files with additional constraints.

use std::path::Path;
use std::sync::Arc;

use elbowroom::envelope::{Guarantee, Objective};
use elbowroom::model::Task;
use elbowroom::plan::{ParametrizedPlan, format};
use elbowroom::verify::{AnswerError, GivenPlan, Limit, Verified, verify_answer_of_network};
use elbowroom::{given_plan, pddl};
use serde_json::{Value, json};

use super::forgery::Forger;
use super::shared::own::case;
use super::{GUARANTEES, OBJECTIVES, answer_for};

/// A pump with a variable rate, a choice of durations, a bound that is a parameter, and an over-all
/// condition on a number.
const DOMAIN: &str = "
    (define (domain well)
      (:requirements :durative-actions :fluents :duration-inequalities :timed-initial-literals)
      (:predicates (dry) (primed) (full) (open) (washed))
      (:functions (level))
      (:durative-action prime :parameters () :duration (= ?duration 4)
        :condition (at start (dry)) :effect (and (at start (not (dry))) (at end (primed))))
      (:durative-action pump :parameters () :duration (and (>= ?duration 5) (<= ?duration 9))
        :condition (and (at start (primed)) (over all (open)))
        :effect (and (at end (full)) (at end (increase (level) 12))))
      (:durative-action wash :parameters () :duration (>= ?duration 1)
        :synth-parameters ?use
        :condition (and (at start (>= (level) 10)) (over all (>= (level) 3)))
        :effect (and (at start (decrease (level) ?use)) (at end (washed)))))";

const PROBLEM: &str = "
    (define (problem yard) (:domain well)
      (:init (dry) (open) (= (level) 0) (at 30 (not (open)))) (:goal (and (full) (washed))))";

const PLAN: &str = "
    durative-action instance p : (prime);
    durative-action instance q : (pump);
    durative-action instance w : (wash);
    parameter priming default 4;
    parameter washing weight 2 default 6 ub 20;
    parameter gap default 3 lb 1;
    parameter w.?use default 5;
    c: p.end - p.start in [priming, priming];
    c: w.end - w.start in [washing, washing];
    c: q.end - q.start in [5, 9];
    c: q.start - p.end in [gap, inf];
    c: q.end - .zero in [0, 29.999];
    c: w.start - q.end in [0.001, 2];
";

fn task(domain: &str, problem: &str) -> Arc<Task> {
    let source = |name: &str, text: &str| pddl::Source::new(name, text);
    let read = pddl::read_problem(&source("domain", domain), &source("problem", problem));
    Arc::new(Task::new(read.expect("no mistakes").0))
}

fn plan(task: &Task, text: &str) -> ParametrizedPlan {
    format::read(text, task).expect("no mistakes")
}

fn verified(answer: &Value, task: &Task, plan: &ParametrizedPlan) -> Result<Verified, AnswerError> {
    verify_answer_of_network(&answer.to_string(), task, &given_plan(plan))
}

/// Returns problems with plan files that have constraints.
fn all() -> Vec<(Arc<Task>, ParametrizedPlan)> {
    let (delivery, _) = case("delivery");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery/plan.stn");
    let text = std::fs::read_to_string(file).expect("a file of the case");
    let own = plan(&delivery, &text);
    let well = task(DOMAIN, PROBLEM);
    let pumping = plan(&well, PLAN);
    vec![(delivery, own), (well, pumping)]
}

#[test]
fn true_certificates_of_plan_files_with_constraints_are_accepted() {
    let mut accepted = 0;
    for (task, plan) in all() {
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                let Some(answer) = answer_for(&task, &plan, (guarantee, objective), &[]) else {
                    continue;
                };
                let verdict = verified(&answer, &task, &plan);
                let name = &task.problem().domain;
                let what = format!("{name}, {guarantee:?}, {objective:?}");
                let verdict = verdict.unwrap_or_else(|wrong| panic!("{what}: {wrong}"));
                assert!(verdict.assumes.is_empty(), "{what}");
                assert_eq!(verdict.assumed, 0, "{what}");
                accepted += 1;
            }
        }
    }
    println!("{accepted} certificates accepted");
    assert!(accepted >= 10, "{accepted}");
}

/// After any change of the plan file, the certificate belongs to another plan.
#[test]
fn certificate_of_another_plan_file_is_refused() {
    let well = task(DOMAIN, PROBLEM);
    let own = plan(&well, PLAN);
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let answer = answer_for(&well, &own, goals, &[]).expect("a box");
    verified(&answer, &well, &own).expect("it is that of this plan");
    for (old, new) in [
        ("[5, 9]", "[5, 8]"),
        ("[0.001, 2]", "[0.001, inf]"),
        ("[0.001, 2]", "[0.002, 2]"),
        ("c: q.end - .zero in [0, 29.999];", ""),
        (
            "c: w.start - q.end in [0.001, 2];",
            "c: w.start - q.end in [0.001, 2]; c: w.start - p.end in [1, inf];",
        ),
        (
            "c: w.end - w.start in [washing, washing];\n    c: q.end - q.start in [5, 9];",
            "c: q.end - q.start in [5, 9];\n    c: w.end - w.start in [washing, washing];",
        ),
        ("priming default 4", "priming default 5"),
        ("weight 2 default 6", "weight 1 default 6"),
        ("ub 20", "ub 40"),
        ("instance p :", "instance first :"),
    ] {
        let changed = PLAN.replace(old, new);
        let changed = if new == "instance first :" {
            changed
                .replace("p.start", "first.start")
                .replace("p.end", "first.end")
        } else {
            changed
        };
        assert_ne!(changed, PLAN, "{old}");
        let other = plan(&well, &changed);
        let verdict = verified(&answer, &well, &other);
        assert!(verdict.is_err(), "{old} -> {new}");
    }
    // The domain or the problem is another one.
    for (old, new) in [
        ("(>= (level) 3)", "(>= (level) 6)"),
        ("(increase (level) 12)", "(increase (level) 11)"),
        ("(<= ?duration 9)", "(<= ?duration 8)"),
        ("(at 30", "(at 28"),
        ("(at 30", "(at 31"),
    ] {
        let changed = task(&DOMAIN.replace(old, new), &PROBLEM.replace(old, new));
        let own = plan(&changed, PLAN);
        let verdict = verified(&answer, &changed, &own);
        assert!(verdict.is_err(), "{old} -> {new}: {verdict:?}");
    }
}

#[test]
fn quantity_that_an_option_opens_in_a_plan_file_is_named_as_not_derivable() {
    let well = task(DOMAIN, PROBLEM);
    let own = plan(&well, PLAN);
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let answer = answer_for(&well, &own, goals, &["initial (level)"]).expect("a box");
    match verified(&answer, &well, &own) {
        Err(AnswerError::NotDerivable(what)) => assert!(what.contains("--vary"), "{what}"),
        verdict => panic!("{verdict:?}"),
    }
}

#[test]
fn mutated_certificates_of_plan_files_are_refused_unless_they_claim_the_same() {
    let mut forger = Forger::new(0x2545_f491_4f6c_dd1d);
    for (task, plan) in all() {
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                if let Some(answer) = answer_for(&task, &plan, (guarantee, objective), &[]) {
                    let verify = |answer: &Value| verified(answer, &task, &plan);
                    let what = format!("{guarantee:?}, {objective:?}");
                    forger.attack((&answer, 100), &verify, &what);
                }
            }
        }
    }
    assert!(forger.print_counts() > 800);
}

/// Without an order between interfering happenings, or with a duration that the domain forbids,
/// some schedule of the file is invalid.
#[test]
fn plan_file_that_allows_invalid_schedules_has_no_derivable_certificate() {
    let well = task(DOMAIN, PROBLEM);
    let own = plan(&well, PLAN);
    let goals = (Guarantee::Dynamic, Objective::Widths);
    let answer = answer_for(&well, &own, goals, &[]).expect("a box");
    for (index, change) in [(2, "duration"), (5, "order")] {
        let mut given: GivenPlan = given_plan(&own);
        let mut broken = answer.clone();
        // The file and the network are changed in the same way; timed initials come first in the
        // network.
        let place = format!("/best/certificate/constraints/{}", index + 1);
        let constraint = broken.pointer_mut(&place).expect("a constraint");
        if change == "duration" {
            given.constraints[index].upper = Limit::None;
            constraint["upper"] = json!("none");
        } else {
            given.constraints[index].lower = Limit::None;
            constraint["lower"] = json!("none");
        }
        let verdict = verify_answer_of_network(&broken.to_string(), &well, &given);
        assert!(verdict.is_err(), "{change}");
    }
}
