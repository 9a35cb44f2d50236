//! Boxes that are computed by hand.

use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, envelope};
use elbowroom_envelope::{Guarantee, Oracle, irr, sharpen};
use elbowroom_model::Task;
use elbowroom_num::{Interval, Rational};
use elbowroom_pddl::{Source, read_plan};
use elbowroom_plan::{DecoupledEnvelope, format};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::processes_and_events::{refuted, task_of};
use crate::shared;

fn kettle(file: &str) -> (Arc<Task>, Source) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases/kettle");
    let task = shared::task(&folder.join("domain.pddl"), &folder.join("problem.pddl"));
    (
        Arc::new(task.expect("a case without mistakes")),
        shared::source(&folder.join(file)),
    )
}

/// Returns the largest box of a plan with few parameters.
fn largest(task: &Arc<Task>, text: impl Into<Source>) -> DecoupledEnvelope {
    let plan = Arc::new(format::read(text, task).expect("a readable plan"));
    let mut oracle = Oracle::new(task, &plan, Guarantee::Weak).expect("within reach");
    let settings = elbowroom_envelope::Settings::default();
    let run = irr(&mut oracle, &settings, &mut |_| ControlFlow::Continue(()));
    let found = run
        .expect("within reach")
        .envelope
        .expect("it works as planned");
    let found = sharpen(&mut oracle, &found, &mut || ControlFlow::Continue(()));
    found.expect("within reach").expect("it was found inside")
}

/// The box is computed by hand in the problem file.
#[test]
fn kettle_boils_before_tea_is_poured() {
    let (task, text) = kettle("tea.stn");
    let found = largest(&task, &text);
    let number = |text: &str| text.parse::<Rational>().expect("a number");
    let expected = [("6", "10"), ("8.001", "28")]
        .map(|(lower, upper)| Interval::closed(number(lower), number(upper)));
    assert_eq!(found.intervals(), expected);
}

/// Two increasing numbers, and an event with a condition on both.
const CLIMB: &str = "(define (domain d)
    (:predicates (clashed) (seen))
    (:functions (x) (y))
    (:durative-action climb :duration (= ?duration 10) :condition (and)
     :effect (increase (x) (* #t 1)))
    (:durative-action follow :duration (= ?duration 10) :condition (and)
     :effect (increase (y) (* #t 1)))
    (:action look :effect (seen))
    (:event clash :precondition (and (not (clashed)) (<= (x) 6) (> (y) 4))
     :effect (clashed)))";

/// x increases from s on, and y from 5 on. From 9 on, y is above 4. The event would happen then if
/// x were at most 6, which holds until s + 6. Its condition does not hold at any happening of the
/// plan.
#[test]
fn no_event_may_happen_between_two_happenings() {
    let problem = "(define (problem p) (:domain d)
        (:init (= (x) 0) (= (y) 0)) (:goal (not (clashed))))";
    let task = Arc::new(task_of(CLIMB, problem));
    let plan = "durative-action instance first : (climb);
        durative-action instance second : (follow);
        parameter s default 1;
        c: first.start - .zero in [s, s];
        c: first.end - first.start in [10, 10];
        c: second.start - .zero in [5, 5];
        c: second.end - second.start in [10, 10];";
    let until = |last: i64| [Interval::closed(Rational::ZERO, Rational::from(last))];
    assert_eq!(largest(&task, plan).intervals(), until(3));
    // At 8, x is above 6 as planned and y is not above 4. With a happening at that time, the box
    // must preserve one of the two, even if that is not necessary.
    let looking = format!("{plan} action instance eye : (look); c: eye - .zero in [8, 8];");
    assert_eq!(largest(&task, &looking).intervals(), until(2));
}

/// A plan with fixed times keeps its order, and the durations are as free as that order permits.
#[test]
fn a_plan_with_fixed_times_leaves_durations_open() {
    let (task, text) = kettle("tea.plan");
    let (plan, _) = read_plan(&text, &task).expect("a readable plan");
    let request = EnvelopeRequest::new(&task, plan);
    let outcome = envelope(&request, &mut NoObserver).expect("within reach");
    let plan = outcome.plan.expect("a network");
    let found = outcome.envelope.expect("it works as planned");
    let has_room = |own: &Interval| own.width().is_none_or(|width| width.is_positive());
    assert!(found.intervals().iter().all(has_room), "{found:?}");
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    assert_eq!(refuted(&task, &plan, &found, &mut rng), None);
}

/// The lower end is limited by the order of the happenings, not by a longer action.
#[test]
fn explanation_does_not_fit_action_into_itself() {
    let domain = "(define (domain d) (:predicates (boiled) (fetched)) (:functions (heat))
        (:process heats :effect (increase (heat) (* #t 1)))
        (:event boils :precondition (and (not (boiled)) (>= (heat) 10)) :effect (boiled))
        (:durative-action fetch :duration (= ?duration 5) :condition (and)
         :effect (at end (fetched))))";
    let problem = "(define (problem p) (:domain d) (:init (= (heat) 0)) (:goal (fetched)))";
    let task = Arc::new(task_of(domain, problem));
    let (plan, _) = read_plan(&Source::new("plan", "0: (fetch) [5]"), &task).expect("a plan");
    let outcome = envelope(&EnvelopeRequest::new(&task, plan), &mut NoObserver);
    let answer = outcome.expect("within reach").answer;
    let EnvelopeFinding::Envelope { parameters, .. } = answer.finding else {
        panic!("{:?}", answer.finding);
    };
    let limit = |limit: &Option<String>| limit.clone().expect("a reason");
    assert_eq!(
        limit(&parameters[0].lower_limit),
        "(fetch) must not end before it starts"
    );
    assert!(limit(&parameters[0].upper_limit).contains("the event (boils)"));
}
