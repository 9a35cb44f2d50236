//! The largest boxes come with certificates that `elbowroom verify` accepts, and it refuses what is
//! changed in them.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

mod shared;

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, Relax, envelope};
use elbowroom::answers::{EnvelopeOutcome, Halt, Unwatched, Watcher};
use elbowroom::envelope::{BestSettings, Guarantee, Method, Objective};
use elbowroom::model::Task;
use elbowroom::pddl::read_plan;
use elbowroom::plan::ParametrizedPlan;
use elbowroom::verify::{AnswerError, Flaw, verify_answer};
use elbowroom::{AnyPlan, pddl};
use serde_json::Value;
use shared::case::Case;
use shared::changed::{changed, numbers};
use shared::instances::{Instance, figure_3, figure_4};

const GUARANTEES: [Guarantee; 3] = [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong];
const OBJECTIVES: [Objective; 3] = [Objective::LeastSlack, Objective::Widths, Objective::Volume];

/// A case of this repository.
fn case(name: &str) -> (Arc<Task>, AnyPlan) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../cases")
        .join(name);
    let source = |file: &str| {
        let text = std::fs::read_to_string(folder.join(file)).expect("a file of the case");
        pddl::Source::new(file, text)
    };
    let read = pddl::read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Arc::new(Task::new(read.expect("a case without mistakes").0));
    let plan = read_plan(&source("plan.plan"), &task)
        .expect("a plan without mistakes")
        .0;
    (task, plan.into())
}

fn largest(
    task: &Arc<Task>,
    plan: &AnyPlan,
    guarantee: Guarantee,
    objective: Objective,
    symmetric: bool,
) -> EnvelopeOutcome {
    let mut request = EnvelopeRequest::new(task, plan.clone());
    request.guarantee = guarantee;
    request.search.method = Method::Best;
    request.search.best = BestSettings {
        objective,
        symmetric,
        ..BestSettings::default()
    };
    envelope(&request, &mut Unwatched).expect("within exact reasoning")
}

fn written(outcome: &EnvelopeOutcome) -> String {
    serde_json::to_string(&outcome.answer).expect("a document")
}

#[test]
fn certificates_of_all_cases_are_accepted() {
    let (mut accepted, mut assumed, mut without) = (0, 0, 0);
    for name in [
        "battery",
        "delivery",
        "hatchery",
        "lamp",
        "match",
        "paintshop",
        "tank",
    ] {
        let (task, plan) = case(name);
        for guarantee in GUARANTEES {
            for objective in OBJECTIVES {
                for symmetric in [false, true] {
                    let outcome = largest(&task, &plan, guarantee, objective, symmetric);
                    let what = format!("{name}, {guarantee:?}, {objective:?}, {symmetric}");
                    let finding = &outcome.answer.finding;
                    let EnvelopeFinding::Envelope {
                        best, parameters, ..
                    } = finding
                    else {
                        println!("{what}: no envelope");
                        continue;
                    };
                    let Some(best) = best else {
                        assert!(parameters.is_empty(), "{what}");
                        let verdict = verify_answer(&written(&outcome));
                        assert!(matches!(verdict, Err(AnswerError::NoBox)), "{what}");
                        continue;
                    };
                    match verify_answer(&written(&outcome)) {
                        Ok(verified) => {
                            assert_eq!(
                                (&verified.value, &verified.bound),
                                (&best.value, &best.bound)
                            );
                            accepted += 1;
                            assumed += usize::from(verified.assumed > 0);
                        }
                        Err(AnswerError::NoCertificate) => {
                            assert!(!best.is_proved, "{what}");
                            without += 1;
                        }
                        Err(wrong) => panic!("{what}: {wrong}\n{}", written(&outcome)),
                    }
                }
            }
        }
    }
    println!(
        "{accepted} certificates accepted, {assumed} of them with assumptions; {without} boxes without"
    );
    assert!(accepted > 90);
}

/// What the claim is about, in an answer: the box, how good it is, and what no box exceeds.
const CLAIM: [&str; 5] = [
    "/parameters",
    "/best/most",
    "/best/value",
    "/best/bound",
    "/best/certificate",
];

#[test]
fn each_number_that_is_changed_in_turn_makes_a_certificate_refused() {
    let mut count = 0;
    let mut unnoticed = Vec::new();
    for (name, guarantee, objective) in [
        ("delivery", Guarantee::Dynamic, Objective::LeastSlack),
        ("delivery", Guarantee::Dynamic, Objective::Widths),
        ("delivery", Guarantee::Strong, Objective::Widths),
        ("delivery", Guarantee::Dynamic, Objective::Volume),
        ("delivery", Guarantee::Strong, Objective::Volume),
        ("hatchery", Guarantee::Dynamic, Objective::Volume),
        ("hatchery", Guarantee::Dynamic, Objective::LeastSlack),
        ("hatchery", Guarantee::Dynamic, Objective::Widths),
        ("paintshop", Guarantee::Weak, Objective::LeastSlack),
    ] {
        let (task, plan) = case(name);
        let outcome = largest(&task, &plan, guarantee, objective, false);
        let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
        verify_answer(&answer.to_string()).expect("it is right as it is");
        let mut places = Vec::new();
        for place in CLAIM {
            numbers(answer.pointer(place).expect("a member"), place, &mut places);
        }
        assert!(places.len() > 20, "{places:?}");
        for place in places {
            let mut broken = answer.clone();
            let number = broken.pointer_mut(&place).expect("a place of the document");
            *number = changed(number);
            if verify_answer(&broken.to_string()).is_ok() {
                unnoticed.push(format!("{name}, {guarantee:?}, {objective:?}: {place}"));
            }
            count += 1;
        }
    }
    assert!(unnoticed.is_empty(), "of {count}: {unnoticed:#?}");
    println!("{count} changed numbers were noticed");
}

#[test]
fn durations_that_follow_each_other_in_a_circle_or_end_together_are_refused() {
    let (task, plan) = case("hatchery");
    let (guarantee, objective) = (Guarantee::Dynamic, Objective::Widths);
    let outcome = largest(&task, &plan, guarantee, objective, false);
    let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
    let constraints = "/best/certificate/constraints";
    let all = answer.pointer(constraints).and_then(Value::as_array);
    let all = all.expect("a list").iter().enumerate();
    let observed = all.filter(|(_, own)| own["observed"] == true);
    let places: Vec<usize> = observed.map(|(place, _)| place).collect();
    let [one, other] = places[..] else {
        panic!("the brooding and the shot: {answer}");
    };
    let with = |changes: &[(usize, &str, usize, &str)]| {
        let mut broken = answer.clone();
        for (place, member, source, from) in changes {
            let value = answer.pointer(&format!("{constraints}/{source}/{from}"));
            broken.pointer_mut(constraints).expect("a list")[*place][*member] =
                value.expect("a point").clone();
        }
        verify_answer(&broken.to_string())
    };
    for changes in [
        &[(one, "from", other, "to"), (other, "from", one, "to")][..],
        &[(one, "to", other, "to")],
        &[(one, "to", one, "from")],
    ] {
        let refused = with(changes);
        assert!(
            matches!(refused, Err(AnswerError::Flaw(Flaw::NoDuration(_)))),
            "{changes:?}: {refused:?}"
        );
    }
}

#[test]
fn a_claim_that_says_more_than_is_proved_is_refused() {
    let (task, plan) = case("battery");
    let (guarantee, objective) = (Guarantee::Dynamic, Objective::Widths);
    let outcome = largest(&task, &plan, guarantee, objective, false);
    let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
    let verified = verify_answer(&answer.to_string()).expect("it is right as it is");
    assert!(verified.assumed > 0, "conditions on a charge");
    assert_eq!(verified.assumes.len(), 2 + verified.assumed);
    for place in 0..verified.assumes.len() {
        let mut bold = answer.clone();
        let assumes = bold.pointer_mut("/best/certificate/assumes");
        let assumes = assumes.and_then(Value::as_array_mut).expect("a list");
        assumes.remove(place);
        let refused = verify_answer(&bold.to_string());
        assert!(
            matches!(refused, Err(AnswerError::Flaw(Flaw::Claim))),
            "{place}: {refused:?}"
        );
    }
}

#[test]
fn a_bound_is_worth_what_is_gained_when_it_is_relaxed() {
    let relaxed = |closing: &str, objective| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/delivery");
        let text = |file: &str| std::fs::read_to_string(folder.join(file)).expect("a file");
        let problem = text("problem.pddl").replace("(at 60 ", &format!("(at {closing} "));
        let domain = pddl::Source::new("domain.pddl", text("domain.pddl"));
        let read = pddl::read_problem(&domain, &pddl::Source::new("problem.pddl", problem));
        let task = Arc::new(Task::new(read.expect("no mistakes").0));
        let plan = pddl::Source::new("plan.plan", text("plan.plan"));
        let plan = read_plan(&plan, &task).expect("no mistakes").0;
        let outcome = largest(&task, &plan.into(), Guarantee::Dynamic, objective, false);
        let EnvelopeFinding::Envelope { best, .. } = outcome.answer.finding else {
            panic!("an envelope");
        };
        best.expect("a largest box")
    };
    for objective in [Objective::LeastSlack, Objective::Widths] {
        // Early enough for the deadline to be what limits the least slack.
        let (before, after) = (relaxed("35", objective), relaxed("36", objective));
        assert!(before.is_proved && after.is_proved);
        let deadline = before.worth.iter().find(|own| own.bound.contains("35"));
        let deadline = deadline.unwrap_or_else(|| panic!("{:?}", before.worth));
        assert_eq!(deadline.relax, Relax::More);
        assert_eq!(after.value - before.value, deadline.gain);
    }
}

/// Ends a search after some steps.
struct Patience(usize);

impl Watcher for Patience {
    fn flow(&mut self) -> ControlFlow<Halt> {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            return ControlFlow::Break(Halt::TimeLimit);
        }
        ControlFlow::Continue(())
    }
}

/// Searches a published plan, and checks the certificate: accepted, with how many assumptions, in
/// how many seconds.
#[allow(
    clippy::disallowed_methods,
    reason = "how long a check takes is worth seeing"
)]
fn of_published(
    instance: &Instance,
    guarantee: Guarantee,
    objective: Objective,
) -> Option<(usize, f64)> {
    let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
    let plan = ParametrizedPlan::clone(&case.plan);
    let mut request = EnvelopeRequest::new(&case.task, plan);
    request.guarantee = guarantee;
    request.search.method = Method::Best;
    request.search.best.objective = objective;
    let outcome = envelope(&request, &mut Patience(2_000)).expect("within exact reasoning");
    let text = written(&outcome);
    let begun = Instant::now();
    let verdict = verify_answer(&text);
    let seconds = begun.elapsed().as_secs_f64();
    match verdict {
        Ok(verified) => Some((verified.assumed, seconds)),
        Err(AnswerError::NoCertificate | AnswerError::NoBox) => None,
        Err(wrong) => panic!("{}, {guarantee:?}, {objective:?}: {wrong}", instance.name),
    }
}

#[test]
fn certificates_of_published_plans_are_accepted() {
    let Some(data) = shared::data() else { return };
    for (family, instances) in [
        ("AAAI-19", figure_3(&data)),
        ("robot deliveries", figure_4(&data)),
    ] {
        let (mut accepted, mut assuming, mut without) = (0, 0, 0);
        let mut longest: f64 = 0.0;
        for instance in &instances {
            for guarantee in GUARANTEES {
                for objective in OBJECTIVES {
                    match of_published(instance, guarantee, objective) {
                        Some((assumed, seconds)) => {
                            accepted += 1;
                            assuming += usize::from(assumed > 0);
                            longest = longest.max(seconds);
                        }
                        None => without += 1,
                    }
                }
            }
        }
        println!(
            "{family}: {accepted} certificates accepted, {assuming} with assumptions, {without} \
             answers without; the longest check took {:.1} ms",
            longest * 1000.0
        );
        assert!(accepted > 0);
    }
}
