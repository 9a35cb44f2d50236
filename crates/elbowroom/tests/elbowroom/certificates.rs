//! Certificates of the largest boxes: `elbowroom verify` accepts them, and rejects modified ones.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

pub(crate) mod judge;

use crate::shared;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use crate::shared::case::Case;
use crate::shared::changed::{changed, numbers};
use crate::shared::instances::{Instance, figure_3, figure_4};
use crate::shared::own::case;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, Relax, Search, envelope};
use elbowroom::answers::{EnvelopeOutcome, NoObserver, Observer, StopRequest};
use elbowroom::envelope::{BestSettings, Guarantee, Method, Objective};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl::read_plan;
use elbowroom::plan::ParametrizedPlan;
use elbowroom::verify::sound::{Control, FailureCase, Schedules, Sound, Violation};
use elbowroom::verify::{AnswerError, Certificate, Flaw, Verified, verify_answer, with_sums};
use elbowroom::{AnyPlan, pddl};
use judge::{certificate_in, is_about_the_box};
use serde_json::Value;

const GUARANTEES: [Guarantee; 3] = [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong];
const OBJECTIVES: [Objective; 3] = [Objective::LeastSlack, Objective::Widths, Objective::Volume];

fn largest(
    task: &Arc<Task>,
    plan: &AnyPlan,
    guarantee: Guarantee,
    objective: Objective,
    symmetric: bool,
) -> EnvelopeOutcome {
    let mut request = EnvelopeRequest::new(task, plan.clone());
    request.guarantee = guarantee;
    request.search.method = Some(Method::Best);
    request.search.best = BestSettings {
        objective,
        symmetric,
        ..BestSettings::default()
    };
    envelope(&request, &mut NoObserver).expect("within exact reasoning")
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
                            let inside = verified.inside.expect("plans are small");
                            assert!(inside.is_proved(), "{what}: {:?}", verified.assumes);
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

/// Claim of an answer: the box, its value, and the upper bound for all boxes.
const CLAIM: [&str; 5] = [
    "/parameters",
    "/best/most",
    "/best/value",
    "/best/bound",
    "/best/certificate",
];

/// Cases whose certificates contain each kind of proof.
const CHANGED: [(&str, Guarantee, Objective); 13] = [
    ("delivery", Guarantee::Dynamic, Objective::LeastSlack),
    ("delivery", Guarantee::Dynamic, Objective::Widths),
    ("delivery", Guarantee::Strong, Objective::Widths),
    ("delivery", Guarantee::Dynamic, Objective::Volume),
    ("delivery", Guarantee::Strong, Objective::Volume),
    ("hatchery", Guarantee::Dynamic, Objective::Volume),
    ("hatchery", Guarantee::Dynamic, Objective::LeastSlack),
    ("hatchery", Guarantee::Dynamic, Objective::Widths),
    ("paintshop", Guarantee::Weak, Objective::LeastSlack),
    ("lamp", Guarantee::Weak, Objective::Widths),
    ("battery", Guarantee::Dynamic, Objective::LeastSlack),
    ("battery", Guarantee::Weak, Objective::LeastSlack),
    ("match", Guarantee::Strong, Objective::LeastSlack),
];

/// A modified certificate that is accepted must still be a proof of the answer's claim: if a bound
/// of the network or of a failure has slack, another number is equally valid.
#[test]
fn changed_number_invalidates_certificate_or_leaves_it_valid() {
    let (mut count, mut still) = (0, 0);
    let mut wrong = Vec::new();
    for (name, guarantee, objective) in CHANGED {
        let (task, plan) = case(name);
        let outcome = largest(&task, &plan, guarantee, objective, false);
        let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
        verify_answer(&answer.to_string()).expect("it is right as it is");
        assert!(
            judge::is_inside(&certificate_in(&answer)),
            "{name}, {guarantee:?}"
        );
        let mut places = Vec::new();
        for place in CLAIM {
            numbers(answer.pointer(place).expect("a member"), place, &mut places);
        }
        assert!(places.len() > 20, "{places:?}");
        for place in places {
            let mut broken = answer.clone();
            let number = broken.pointer_mut(&place).expect("a place of the document");
            *number = changed(number);
            count += 1;
            if verify_answer(&broken.to_string()).is_err() {
                continue;
            }
            still += 1;
            let is_true = judge::is_inside(&certificate_in(&broken));
            if !is_true || !is_about_the_box(&answer, &place) {
                wrong.push(format!("{name}, {guarantee:?}, {objective:?}: {place}"));
            }
        }
    }
    assert!(wrong.is_empty(), "of {count}: {wrong:#?}");
    assert!(20 * still < count, "{still} of {count}");
    println!("{count} numbers changed: {still} proofs stayed proofs");
}

/// The proof of the right box does not prove a box that is slightly too large.
#[test]
fn a_box_with_an_end_beyond_the_envelope_is_refused() {
    let (mut outside, mut inside) = (0, 0);
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
            let outcome = largest(&task, &plan, guarantee, Objective::Widths, false);
            let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
            if answer.pointer("/best/certificate").is_none() {
                continue;
            }
            let right = certificate_in(&answer);
            for variable in 0..right.slacks.len() {
                let mut larger = right.clone();
                larger.slacks[variable].0 += Rational::new(1, 1000);
                let is_inside = judge::is_inside(&larger);
                let sound = with_sums(larger).ok().and_then(|told| told.sound);
                let is_proved = sound.is_some_and(|sound| {
                    let mut conditions = sound.conditions.iter().flatten();
                    sound.control != Control::Assumed && conditions.all(|own| !own.cases.is_empty())
                });
                assert!(is_inside || !is_proved, "{name}, {guarantee:?}, {variable}");
                outside += usize::from(!is_inside);
                inside += usize::from(is_inside);
            }
        }
    }
    println!("{outside} boxes that are outside, {inside} that are inside");
    assert!(outside > 20);
}

#[test]
fn circular_or_simultaneous_durations_are_rejected() {
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
fn claim_beyond_the_proof_is_rejected() {
    let (task, plan) = case("battery");
    let (guarantee, objective) = (Guarantee::Dynamic, Objective::Widths);
    let outcome = largest(&task, &plan, guarantee, objective, false);
    let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
    let verified = verify_answer(&answer.to_string()).expect("it is right as it is");
    assert!(verified.assumed > 0, "conditions on a charge");
    let inside = verified.inside.expect("the plan is small");
    assert!(inside.is_proved(), "{inside:?}");
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

/// Finds the places of all decimals next to an exact number.
fn decimals(value: &Value, place: &str, found: &mut Vec<String>) {
    match value {
        Value::Array(items) => {
            for (index, item) in items.iter().enumerate() {
                decimals(item, &format!("{place}/{index}"), found);
            }
        }
        Value::Object(members) => {
            if members.contains_key("exact") && members.get("decimal").is_some_and(Value::is_f64) {
                found.push(format!("{place}/decimal"));
            }
            for (name, member) in members {
                let name = name.replace('~', "~0").replace('/', "~1");
                decimals(member, &format!("{place}/{name}"), found);
            }
        }
        _ => {}
    }
}

#[test]
fn wrong_decimal_or_version_anywhere_in_the_answer_is_refused() {
    let (task, plan) = case("delivery");
    let outcome = largest(&task, &plan, GUARANTEES[1], OBJECTIVES[0], false);
    let right: Value = serde_json::from_str(&written(&outcome)).expect("a document");
    let mut places = Vec::new();
    decimals(&right, "", &mut places);
    assert!(places.len() > 50, "{}", places.len());
    for place in places {
        let mut wrong = right.clone();
        *wrong.pointer_mut(&place).expect("a decimal") = Value::from(1234.5);
        assert!(verify_answer(&wrong.to_string()).is_err(), "{place}");
    }
    let mut wrong = right;
    wrong["version"] = Value::from(2);
    assert!(verify_answer(&wrong.to_string()).is_err());
}

#[test]
fn shadow_price_equals_gain_of_relaxation() {
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
        // Early enough for the deadline to limit the least slack.
        let (before, after) = (relaxed("35", objective), relaxed("36", objective));
        assert!(before.is_proved && after.is_proved);
        let deadline = before.worth.iter().find(|own| own.bound.contains("35"));
        let deadline = deadline.unwrap_or_else(|| panic!("{:?}", before.worth));
        assert_eq!(deadline.relax, Relax::More);
        assert_eq!(after.value - before.value, deadline.gain);
    }
}

/// Returns the answer and the certificate for a plan given as text, with some parameters.
fn answer_and_certificate(
    [domain, problem, plan]: [&str; 3],
    vary: &[&str],
    guarantee: Guarantee,
) -> (EnvelopeOutcome, Certificate) {
    let source = |name: &str, text: &str| pddl::Source::new(name, text);
    let read = pddl::read_problem(&source("domain", domain), &source("problem", problem));
    let task = Arc::new(Task::new(read.expect("no mistakes").0));
    let plan = read_plan(&source("plan", plan), &task)
        .expect("no mistakes")
        .0;
    let mut request = EnvelopeRequest::new(&task, plan);
    request.vary = vary
        .iter()
        .map(|own| own.parse().expect("what varies"))
        .collect();
    request.guarantee = guarantee;
    request.search = Search::best(Objective::Widths);
    let outcome = envelope(&request, &mut NoObserver).expect("within exact reasoning");
    let text = written(&outcome);
    let verified = verify_answer(&text).expect("a certificate");
    let inside = verified.inside.expect("the plan is small");
    assert!(inside.is_proved(), "{:?}", verified.assumes);
    let answer: Value = serde_json::from_str(&text).expect("a document");
    (outcome, certificate_in(&answer))
}

const PASSAGE: [&str; 3] = [
    "(define (domain passage)
       (:requirements :durative-actions :timed-initial-literals)
       (:predicates (early) (open) (done))
       (:durative-action sail :parameters () :duration (= ?duration 15)
         :condition (and (at start (early)) (at end (open))) :effect (at end (done))))",
    "(define (problem tide) (:domain passage)
       (:init (early) (at 1 (not (early))) (at 10 (open)) (at 30 (not (open))))
       (:goal (done)))",
    "0: (sail) [15]",
];

#[test]
fn duration_limited_on_both_sides_needs_schedules_for_both_ends() {
    let (_, certificate) = answer_and_certificate(PASSAGE, &[], Guarantee::Weak);
    assert!(judge::is_inside(&certificate));
    let sound = certificate.sound.clone().expect("why it is inside");
    let Control::Schedules(cases) = &sound.control else {
        panic!("{sound:?}");
    };
    let splits = cases
        .iter()
        .filter(|case| matches!(case, Schedules::Split { .. }));
    assert!(splits.count() > 0, "{cases:?}");
    // Each of the cases is needed.
    for place in 0..cases.len() {
        let mut fewer = cases.clone();
        fewer.remove(place);
        let mut broken = certificate.clone();
        broken.sound = Some(Sound {
            control: Control::Schedules(fewer),
            ..sound.clone()
        });
        let told = with_sums(broken).expect("sums").sound.expect("some of it");
        assert_eq!(told.control, Control::Assumed, "{place}");
    }
}

const TANK: [&str; 3] = [
    "(define (domain tank)
       (:requirements :durative-actions :fluents :duration-inequalities :continuous-effects)
       (:predicates (filled))
       (:functions (level))
       (:durative-action fill :parameters ()
         :duration (= ?duration 10)
         :condition (over all (<= (level) 30))
         :effect (and (increase (level) (* #t 2)) (at end (filled)))))",
    "(define (problem rain) (:domain tank) (:init (= (level) 0)) (:goal (and (filled) (>= (level) 15))))",
    "0: (fill) [10]",
];

#[test]
fn products_of_rates_and_times_are_checked_at_both_ends() {
    for guarantee in GUARANTEES {
        let vary = ["constant fill level in [1, 4]", "duration fill"];
        let (_, certificate) = answer_and_certificate(TANK, &vary[..], guarantee);
        assert!(judge::is_inside(&certificate));
        let sound = certificate.sound.as_ref().expect("why it is inside");
        let cases = sound.conditions.iter().flatten().flat_map(|own| &own.cases);
        let ways = cases.flat_map(|case| match case {
            FailureCase::Ways(ways) => &ways[..],
            _ => &[],
        });
        let multiplied: Vec<&Violation> = ways.filter(|way| !way.corners.is_empty()).collect();
        assert!(!multiplied.is_empty(), "{guarantee:?}");
        assert!(
            multiplied
                .iter()
                .all(|way| way.sums.len() == 1 << way.corners.len())
        );
        // A sum for one end is not a proof for both.
        let mut broken = certificate.clone();
        let conditions = broken
            .sound
            .as_mut()
            .and_then(|own| own.conditions.as_mut());
        for case in conditions
            .into_iter()
            .flatten()
            .flat_map(|own| &mut own.cases)
        {
            if let FailureCase::Ways(ways) = case {
                for way in ways.iter_mut().filter(|way| way.sums.len() > 1) {
                    way.sums.truncate(1);
                    way.corners.clear();
                }
            }
        }
        let told = with_sums(broken).expect("sums").sound.expect("some of it");
        let mut conditions = told.conditions.iter().flatten();
        assert!(conditions.any(|own| own.cases.is_empty()), "{guarantee:?}");
    }
}

/// Watcher that ends a search after some steps.
struct StepLimit(usize);

impl Observer for StepLimit {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.0 = self.0.saturating_sub(1);
        if self.0 == 0 {
            return ControlFlow::Break(StopRequest::TimeLimit);
        }
        ControlFlow::Continue(())
    }
}

/// Searches a published plan, and checks that its certificate is accepted. Prints the number of
/// assumptions and the time.
#[allow(
    clippy::disallowed_methods,
    reason = "how long a check takes is worth seeing"
)]
fn of_published(
    instance: &Instance,
    guarantee: Guarantee,
    objective: Objective,
) -> Option<(Verified, String, f64)> {
    let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
    let plan = ParametrizedPlan::clone(&case.plan);
    let mut request = EnvelopeRequest::new(&case.task, plan);
    request.guarantee = guarantee;
    request.search.method = Some(Method::Best);
    request.search.best.objective = objective;
    let outcome = envelope(&request, &mut StepLimit(2_000)).expect("within exact reasoning");
    let text = written(&outcome);
    let begun = Instant::now();
    let verdict = verify_answer(&text);
    let seconds = begun.elapsed().as_secs_f64();
    match verdict {
        Ok(verified) => Some((verified, text, seconds)),
        Err(AnswerError::NoCertificate | AnswerError::NoBox) => None,
        Err(wrong) => panic!("{}, {guarantee:?}, {objective:?}: {wrong}", instance.name),
    }
}

#[test]
fn certificates_of_published_plans_are_accepted() {
    let Some(data) = shared::data() else { return };
    let mut kinds = Kinds::default();
    for (family, instances) in [
        ("AAAI-19", figure_3(&data)),
        ("robot deliveries", figure_4(&data)),
    ] {
        let (mut accepted, mut assuming, mut without) = (0, 0, 0);
        let (mut longest, mut largest) = (0.0_f64, 0);
        let mut conditions = 0;
        for instance in instances.iter().step_by(shared::one_in(4)) {
            for guarantee in GUARANTEES {
                for objective in OBJECTIVES {
                    match of_published(instance, guarantee, objective) {
                        Some((verified, proof, seconds)) => {
                            let size = proof.len();
                            accepted += 1;
                            assuming += usize::from(verified.assumed > 0);
                            longest = longest.max(seconds);
                            largest = largest.max(size);
                            let inside = verified.inside.expect("plans are small");
                            let what = format!("{}, {guarantee:?}, {objective:?}", instance.name);
                            assert!(inside.is_proved(), "{what}: {:?}", verified.assumes);
                            conditions += inside.conditions.unwrap_or_default();
                            kinds.count(&proof);
                        }
                        None => without += 1,
                    }
                }
            }
        }
        println!(
            "{family}: {accepted} certificates accepted, {assuming} with assumptions, {without} \
             answers without; {conditions} conditions; the longest check took {:.1} ms, the largest \
             answer has {largest} bytes",
            longest * 1000.0
        );
        assert!(accepted > 0);
    }
    println!("{kinds:?}");
}

/// Number of proofs of each kind. Each kind must occur for the test to cover it.
#[derive(Debug, Default)]
struct Kinds {
    bounds: usize,
    waits: usize,
    splits: usize,
    rules: usize,
    moments: usize,
    inequalities: usize,
    products: usize,
}

impl Kinds {
    fn count(&mut self, answer: &str) {
        for (text, count) in [
            ("\"most\":", &mut self.bounds),
            ("\"delay\":", &mut self.waits),
            ("\"split\":", &mut self.splits),
            ("\"rule\":", &mut self.rules),
            ("\"during\":", &mut self.moments),
            ("\"inequalities\":[", &mut self.inequalities),
            ("\"corners\":", &mut self.products),
        ] {
            *count += answer.matches(text).count();
        }
    }
}
