//! Box with the greatest probability that all durations stay inside, its certificate, and rejected
//! requests.

#![allow(clippy::print_stdout, reason = "counts are worth seeing")]

use crate::certificates::judge;

use crate::shared;
use std::sync::Arc;
use std::time::Instant;

use crate::shared::case::Case;
use crate::shared::changed::{changed, numbers};
use crate::shared::instances::{figure_3, figure_4};
use crate::shared::own::case;
use elbowroom::answers::envelope::{Best, EnvelopeFinding, EnvelopeRequest, envelope};
use elbowroom::answers::{EnvelopeOutcome, NoObserver, RequestError};
use elbowroom::envelope::{BestSettings, Guarantee, Method, Objective};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::pddl;
use elbowroom::plan::ParametrizedPlan;
use elbowroom::sim::WorldModel;
use elbowroom::verify::{AnswerError, verify_answer};
use elbowroom::{AnyPlan, DistributionError};
use serde_json::Value;

/// Every duration is distributed around its nominal value.
const AROUND: &str = "
    [[duration]]
    action = \"*\"
    normal = { mean = 1, deviation = 0.15 }
    relative = true";

/// A mixture of distributions.
const MIXED: &str = "
    [[duration]]
    action = \"*\"
    normal = { mean = 1.1, deviation = 0.3, minimum = 0.8, maximum = 1.4 }
    relative = true
    [[duration]]
    action = \"unlock\"
    triangular = { from = 4, mode = 6, to = 30 }
    [[duration]]
    action = \"pick\"
    values = [1.5, 2, 2, 2.5, 4]
    [[duration]]
    action = \"drop\"
    lognormal = { mean = 3, deviation = 0.4 }";

fn world(sections: &str, task: &Task) -> Arc<WorldModel> {
    let text = format!("format = \"elbowroom-world\"\nversion = 1\n{sections}");
    let source = pddl::Source::new("world", text);
    Arc::new(WorldModel::read(&source, task.problem()).expect("a world without mistakes"))
}

fn request(task: &Arc<Task>, plan: impl Into<AnyPlan>, sections: &str) -> EnvelopeRequest {
    let mut request = EnvelopeRequest::new(task, plan);
    request.world = Some(world(sections, task));
    request.search.method = Some(Method::Best);
    request.search.best = BestSettings {
        objective: Objective::Probability,
        ..BestSettings::default()
    };
    request
}

fn answered(request: &EnvelopeRequest) -> EnvelopeOutcome {
    envelope(request, &mut NoObserver).expect("within exact reasoning")
}

fn best(outcome: &EnvelopeOutcome) -> &Best {
    let EnvelopeFinding::Envelope {
        best: Some(best), ..
    } = &outcome.answer.finding
    else {
        panic!("{:?}", outcome.answer.finding);
    };
    best
}

fn written(outcome: &EnvelopeOutcome) -> String {
    serde_json::to_string(&outcome.answer).expect("a document")
}

#[test]
fn certificates_of_the_most_likely_boxes_are_accepted() {
    for (name, sections) in [
        ("delivery", AROUND),
        ("delivery", MIXED),
        ("hatchery", AROUND),
        ("match", AROUND),
        ("paintshop", AROUND),
    ] {
        let (task, plan) = case(name);
        for guarantee in [Guarantee::Weak, Guarantee::Dynamic, Guarantee::Strong] {
            for symmetric in [false, true] {
                let mut request = request(&task, plan.clone(), sections);
                request.guarantee = guarantee;
                request.search.best.symmetric = symmetric;
                let outcome = answered(&request);
                let what = format!("{name} {guarantee} {symmetric}: {}", written(&outcome));
                let best = best(&outcome);
                assert!(best.is_proved, "{what}");
                let probability = best.probability.as_ref().expect("what was asked for");
                assert!(probability.least <= probability.most, "{what}");
                let verified = verify_answer(&written(&outcome));
                let verified = verified.unwrap_or_else(|wrong| panic!("{wrong} {what}"));
                assert_eq!(verified.bound, best.bound, "{what}");
            }
        }
    }
}

#[test]
fn changed_number_invalidates_certificate_or_leaves_it_valid() {
    let (mut count, mut still, mut wrong) = (0, 0, Vec::new());
    for (name, sections) in [
        ("delivery", AROUND),
        ("delivery", MIXED),
        ("hatchery", AROUND),
    ] {
        let (task, plan) = case(name);
        let outcome = answered(&request(&task, plan, sections));
        let answer: Value = serde_json::from_str(&written(&outcome)).expect("a document");
        verify_answer(&answer.to_string()).expect("it is right as it is");
        let mut places = Vec::new();
        for place in [
            "/parameters",
            "/best/value",
            "/best/bound",
            "/best/certificate",
        ] {
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
            let is_true = judge::is_inside(&judge::certificate_in(&broken));
            if !is_true || !judge::is_about_the_box(&answer, &place) {
                let was = answer.pointer(&place);
                wrong.push(format!("{name}: {place} {was:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "of {count}: {wrong:#?}");
    assert!(20 * still < count, "{still} of {count}");
    println!("{count} numbers changed: {still} proofs stayed proofs");
}

#[test]
fn most_likely_box_beats_irr_and_random_boxes() {
    let (task, plan) = case("delivery");
    let likely = answered(&request(&task, plan.clone(), AROUND));
    let best_one = best(&likely).probability.clone().expect("a probability");
    let chances = elbowroom::duration_distributions(
        likely.plan.as_ref().expect("a plan"),
        &world(AROUND, &task),
    );
    let chances = chances.expect("normal distributions");
    let resolution = Rational::new(1, 1000);
    for method in [Method::Irr, Method::Best] {
        let mut other = request(&task, plan.clone(), AROUND);
        other.search.method = Some(method);
        other.search.best.objective = Objective::Volume;
        let outcome = answered(&other);
        let found = outcome.envelope.expect("an envelope");
        let mut product = Rational::ONE;
        for (interval, chance) in found.intervals().iter().zip(&chances) {
            let far = Rational::from(1_000_000);
            let lower = interval.lower.value().cloned().unwrap_or(-&far);
            let upper = interval.upper.value().cloned().unwrap_or(far);
            let chance = chance.as_ref().expect("all durations vary");
            product *= &chance.probability_inside([&lower, &upper], &resolution);
        }
        assert!(
            product <= best_one.most,
            "{method:?}: {product} {best_one:?}"
        );
        println!("{method:?}: {}", product.to_f64());
    }
    println!("best: {}", best_one.least.to_f64());
}

#[test]
fn infeasible_duration_gives_probability_zero() {
    let (task, plan) = case("delivery");
    let never = "[[duration]]\naction = \"pick\"\nconstant = 500";
    let outcome = answered(&request(&task, plan.clone(), never));
    let found = best(&outcome);
    assert!(found.is_proved);
    assert!(
        found
            .probability
            .as_ref()
            .is_some_and(|own| own.most.is_zero())
    );
    let verdict = verify_answer(&written(&outcome));
    assert!(
        matches!(verdict, Err(AnswerError::NoCertificate)),
        "nothing is proved of a box without probability: {verdict:?}"
    );
    // Exactly as planned, with certainty.
    let always = "[[duration]]\naction = \"pick\"\nconstant = 2";
    let outcome = answered(&request(&task, plan, always));
    let certain = best(&outcome).probability.clone().expect("a probability");
    assert_eq!(
        (certain.least, certain.most),
        (Rational::ONE, Rational::ONE)
    );
}

#[test]
fn unknown_probability_is_rejected_with_advice() {
    let (task, plan) = case("delivery");
    let mut without = request(&task, plan.clone(), AROUND);
    without.world = None;
    let refused = envelope(&without, &mut NoObserver);
    assert!(matches!(
        refused,
        Err(RequestError::Distribution(DistributionError::NoWorld))
    ));
    let mut deadline = request(&task, plan, AROUND);
    deadline.vary = vec![
        "deadline (counter-open office)"
            .parse()
            .expect("a specification"),
    ];
    if let Err(refused) = envelope(&deadline, &mut NoObserver) {
        assert!(
            refused.to_string().contains("supports durations only"),
            "{refused}"
        );
    } else {
        panic!("a deadline is no duration");
    }
}

#[test]
#[allow(
    clippy::disallowed_methods,
    reason = "how long a search and a check take is worth seeing"
)]
fn certificates_of_published_plans_are_accepted() {
    let Some(data) = shared::data() else { return };
    let aaai = || ("AAAI-19", figure_3(&data));
    for (guarantee, (family, instances)) in [
        (Guarantee::Weak, aaai()),
        (Guarantee::Dynamic, aaai()),
        // Nearly all of these have no slack.
        (Guarantee::Strong, aaai()),
        (Guarantee::Dynamic, ("robot deliveries", figure_4(&data))),
    ] {
        let (mut proved, mut unproved, mut without) = (0, 0, 0);
        let (mut search, mut check) = (0.0_f64, 0.0_f64);
        for instance in instances.iter().step_by(shared::one_in(4)) {
            let case = Case::read(&instance.domain, &instance.problem, &instance.plan);
            let plan = ParametrizedPlan::clone(&case.plan);
            let mut request = request(&case.task, plan, AROUND);
            request.guarantee = guarantee;
            let begun = Instant::now();
            let outcome = match envelope(&request, &mut NoObserver) {
                Ok(outcome) => outcome,
                Err(RequestError::Distribution(_)) => continue,
                Err(wrong) => panic!("{}: {wrong}", instance.name),
            };
            search = search.max(begun.elapsed().as_secs_f64());
            let text = written(&outcome);
            let begun = Instant::now();
            match verify_answer(&text) {
                Ok(_) if best(&outcome).is_proved => proved += 1,
                Ok(_) => {
                    let own = best(&outcome);
                    println!(
                        "{}: {} {}",
                        instance.name,
                        own.value.to_f64(),
                        own.bound.to_f64()
                    );
                    unproved += 1;
                }
                Err(AnswerError::NoBox | AnswerError::NoCertificate) => without += 1,
                Err(wrong) => panic!("{}: {wrong} {text}", instance.name),
            }
            check = check.max(begun.elapsed().as_secs_f64());
        }
        println!(
            "{family}, {guarantee}: {proved} proved, {unproved} not, {without} without; the longest answer took \
             {:.0} ms, the longest check {:.1} ms",
            search * 1000.0,
            check * 1000.0
        );
        assert!(proved > 0 && unproved == 0);
    }
}
