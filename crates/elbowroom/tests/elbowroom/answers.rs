//! Requests and their answers: their contents, serialization, and interruption by a watcher.

use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::check::{CheckAnswer, CheckFinding, CheckRequest, check};
use elbowroom::answers::envelope::{EnvelopeFinding, NominalFailure, Search, Stop, envelope};
use elbowroom::answers::plan as planning;
use elbowroom::answers::plan::{PlanFinding, PlanOutcome, PlanRequest, PlanStop};
use elbowroom::answers::stn::{StnFinding, StnRequest, stn};
use elbowroom::answers::{EnvelopeAnswer, EnvelopeOutcome, EnvelopeRequest, Exact};
use elbowroom::answers::{Event, NoObserver, Observer, StopRequest};
use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::TimeoutRule;
use elbowroom::execution::{PlanForm, Preparer};
use elbowroom::model::validate::Settings;
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::{Interval, Rational};
use elbowroom::pddl::{self, Source};
use elbowroom::plan::{Node, Valuation};
use elbowroom::stn::{ConsistentNetwork, NodeId};
use elbowroom::verify::no_plan::{
    Kind as NoPlanKind, NoPlanAnswerError, certificate_of, verify_no_plan,
};
use elbowroom::{AnyPlan, pipeline, plan};
use serde::Serialize;
use serde::de::DeserializeOwned;

const CASES: [&str; 4] = ["battery", "delivery", "match", "tank"];

fn text(case: &str, file: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../cases");
    fs::read_to_string(folder.join(case).join(file)).expect("a file of the case")
}

fn read(case: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    read_with(case, &text(case, "plan.plan"))
}

fn read_with(case: &str, plan: &str) -> (Arc<Task>, TimeTriggeredPlan) {
    let source = |file: &str| Source::new(file, text(case, file));
    let read = pddl::read_problem(&source("domain.pddl"), &source("problem.pddl"));
    let task = Task::new(read.expect("a case without mistakes").0);
    let plan = pddl::read_plan(&Source::new("plan", plan), &task);
    let plan = plan.expect("a plan without mistakes").0;
    (Arc::new(task), plan)
}

fn envelope_of(request: &EnvelopeRequest) -> EnvelopeOutcome {
    envelope(request, &mut NoObserver).expect("within exact reasoning")
}

/// Checks that an answer is deserialized and serialized again to the same bytes.
fn assert_stored<T: Serialize + DeserializeOwned>(answer: &T) -> String {
    let written = serde_json::to_string_pretty(answer).expect("a document");
    let read: T = serde_json::from_str(&written).unwrap_or_else(|e| panic!("{e}\n{written}"));
    let again = serde_json::to_string_pretty(&read).expect("a document");
    assert_eq!(written, again);
    written
}

#[test]
fn answers_round_trip_through_json() {
    for case in CASES {
        let (task, plan) = read(case);
        let mut request = EnvelopeRequest::new(&task, plan.clone());
        // In some cases the domain leaves all durations to the executor.
        request.vary = vec!["durations".parse().expect("a specification")];
        let found = envelope_of(&request);
        assert_stored(&found.answer);
        let opened = found.plan.expect("a valid plan");
        let boxed = elbowroom::write_box(&found.envelope.expect("room"), &opened);
        // Infinite ends exceed every time-out.
        let inside = EnvelopeRequest {
            contains: Some(boxed),
            timeout: TimeoutRule::Off,
            ..request.clone()
        };
        let inside = envelope_of(&inside);
        assert!(matches!(
            inside.answer.finding,
            EnvelopeFinding::Inside { .. }
        ));
        assert_stored(&inside.answer);
        let everything = opened
            .parameters
            .iter()
            .map(|p| format!("{}=[0,inf]", p.name));
        let outside = EnvelopeRequest {
            contains: Some(everything.collect::<Vec<_>>().join(" ")),
            ..request.clone()
        };
        let outside = envelope_of(&outside);
        assert!(matches!(
            outside.answer.finding,
            EnvelopeFinding::Outside { .. }
        ));
        assert_stored(&outside.answer);
        let judged = CheckRequest {
            task: &task,
            plan: Some(&plan),
            name: "plan".to_owned(),
            settings: Settings::default(),
        };
        let judged = check(&judged).expect("decidable");
        assert_stored(&judged);
        let network = stn(&StnRequest {
            task: &task,
            plan: AnyPlan::TimeTriggered(plan),
        });
        assert_stored(&network.expect("a valid plan").answer);
        // With parameters and infinite bounds.
        let network = stn(&StnRequest {
            task: &task,
            plan: AnyPlan::Stn(plan::ParametrizedPlan::clone(&opened)),
        });
        let written = assert_stored(&network.expect("a valid plan").answer);
        assert!(written.contains("\"parameter\": \""));
    }
}

#[test]
fn invalid_plan_is_answered_with_its_violation() {
    let (task, plan) = read_with("delivery", "0: (drive rover depot shelf) [10]");
    let outcome = envelope_of(&EnvelopeRequest::new(&task, plan.clone()));
    assert!(outcome.plan.is_none() && outcome.envelope.is_none());
    let EnvelopeFinding::Fails(NominalFailure::Invalid { violation }) = &outcome.answer.finding
    else {
        panic!("{:?}", outcome.answer)
    };
    let judged = check(&CheckRequest {
        task: &task,
        plan: Some(&plan),
        name: String::new(),
        settings: Settings::default(),
    });
    let Ok(CheckAnswer::Plan(judged)) = judged else {
        panic!("{judged:?}")
    };
    let expected = CheckFinding::Invalid {
        violation: violation.clone(),
    };
    assert_eq!(judged.finding, expected);
    assert_stored(&outcome.answer);
    let network = stn(&StnRequest {
        task: &task,
        plan: plan.into(),
    })
    .expect("an answer");
    let expected = StnFinding::Invalid {
        violation: violation.clone(),
    };
    assert_eq!(network.answer.finding, expected);
    assert_stored(&network.answer);
}

fn planned(task: &Task, watcher: &mut dyn Observer) -> PlanOutcome {
    let mut request = PlanRequest {
        task,
        first_plan_only: true,
        most_memory: None,
        self_overlap: false,
        threads: 1,
    };
    planning::plan(&mut request, watcher).expect("supported")
}

#[test]
fn plan_and_absence_of_a_plan_are_answers() {
    let (task, _) = read("delivery");
    let task = Task::clone(&task);
    let found = planned(&task, &mut NoObserver);
    assert_eq!(
        (found.answer.stop, found.answer.plans),
        (PlanStop::FirstPlan, 1)
    );
    let PlanFinding::Plan { makespan, .. } = &found.answer.finding else {
        panic!("{:?}", found.answer)
    };
    let judged = check(&CheckRequest {
        task: &task,
        plan: found.plan.as_ref(),
        name: String::new(),
        settings: Settings::default(),
    });
    let Ok(CheckAnswer::Plan(judged)) = judged else {
        panic!("{judged:?}")
    };
    assert!(
        matches!(&judged.finding, CheckFinding::Valid { makespan: same, .. } if same == makespan)
    );
    assert_stored(&found.answer);
    let domain = "(define (domain d) (:predicates (p) (q))
        (:action a :parameters () :precondition (p) :effect (q)))";
    let problem = "(define (problem d) (:domain d) (:init) (:goal (q)))";
    let read = pddl::read_problem(
        &Source::new("domain", domain),
        &Source::new("problem", problem),
    );
    let task = Task::new(read.expect("a problem without mistakes").0);
    let none = planned(&task, &mut NoObserver);
    assert!(none.plan.is_none() && none.answer.stop == PlanStop::Proved);
    assert!(matches!(none.answer.finding, PlanFinding::NoPlan { .. }));
    assert_stored(&none.answer);
}

#[test]
fn answer_without_plan_has_proof_or_reason() {
    let fuses = |goal: &str| {
        let domain = "(define (domain d) (:requirements :durative-actions)
            (:predicates (whole) (light) (free) (mended) (wet) (painted))
            (:durative-action burn :parameters () :duration (= ?duration 5)
              :condition (at start (whole))
              :effect (and (at start (not (whole))) (at start (light)) (at end (not (light)))))
            (:durative-action mend :parameters () :duration (= ?duration 3)
              :condition (and (at start (free)) (over all (light)))
              :effect (and (at start (not (free))) (at end (free)) (at end (mended))))
            (:durative-action paint :parameters () :duration (= ?duration 3)
              :condition (and (at start (free)) (over all (light)))
              :effect (and (at start (not (free))) (at end (free)) (at end (painted)))))";
        let problem =
            format!("(define (problem p) (:domain d) (:init (whole) (free)) (:goal (and {goal})))");
        let sources = (
            Source::new("domain", domain),
            Source::new("problem", problem),
        );
        Task::new(
            pddl::read_problem(&sources.0, &sources.1)
                .expect("no mistakes")
                .0,
        )
    };
    let asked = |goal: &str| {
        let task = fuses(goal);
        let mut found = planned(&task, &mut NoObserver).answer;
        found.name_files(["d", "p"]);
        let written = assert_stored(&found);
        (task, certificate_of(&written))
    };
    let (task, certificate) = asked("(mended) (wet)");
    let certificate = certificate.expect("nothing gets wet");
    assert_eq!(certificate.files, ["d", "p"]);
    assert_eq!(verify_no_plan(&task, &certificate), Ok(()));
    assert!(verify_no_plan(&fuses("(mended)"), &certificate).is_err());
    // One match is not enough for both; the earliest times alone do not prove that.
    let (task, both) = asked("(mended) (painted)");
    let both = both.expect("what can happen is listed");
    assert_ne!(both.kind(), NoPlanKind::Reached);
    assert_eq!(verify_no_plan(&task, &both), Ok(()));
    assert!(verify_no_plan(&fuses("(mended)"), &both).is_err());
    let (_, one) = asked("(mended)");
    assert!(matches!(one, Err(NoPlanAnswerError::NotDenied)));
}

#[test]
fn documents_of_another_format_or_version_are_not_read() {
    let (task, plan) = read("match");
    let written = assert_stored(&envelope_of(&EnvelopeRequest::new(&task, plan)).answer);
    let refuses = |text: &str| serde_json::from_str::<EnvelopeAnswer>(text).is_err();
    assert!(!refuses(&written));
    assert!(refuses(
        &written.replace("elbowroom-envelope", "elbowroom-stn")
    ));
    assert!(refuses(
        &written.replace("\"version\": 1", "\"version\": 2")
    ));
}

#[test]
fn ends_with_the_same_reason_are_grouped() {
    let (task, plan) = read("delivery");
    let mut request = EnvelopeRequest::new(&task, plan);
    request.search.sharpen = true;
    let answer = envelope_of(&request).answer;
    let EnvelopeFinding::Envelope {
        parameters,
        makespans,
        ..
    } = &answer.finding
    else {
        panic!("{answer:?}")
    };
    let limits = answer.limits();
    let mut reasons: Vec<&str> = limits.iter().map(|limit| limit.reason.as_str()).collect();
    reasons.sort_unstable();
    reasons.dedup();
    assert_eq!(reasons.len(), limits.len(), "each reason once");
    let limited: usize = limits.iter().map(|l| l.lower.len() + l.upper.len()).sum();
    let known = parameters
        .iter()
        .flat_map(|room| [&room.lower_limit, &room.upper_limit]);
    assert_eq!(limited, known.flatten().count());
    let makespans = makespans.as_ref().expect("a plan with a schedule");
    assert!(makespans.at_lower.as_ref() < Some(&makespans.nominal));
    assert!(makespans.at_upper.as_ref() > Some(&makespans.nominal));
}

#[test]
fn envelope_computed_in_mid_execution_can_be_interrupted() {
    let (task, plan) = read("delivery");
    let prepared = |mut analyst: PlanPreparer<'static>| {
        let prepared = analyst.prepare(&task, &plan, PlanForm::Envelope);
        let envelope = prepared.expect("a valid plan").envelope;
        envelope.expect("it was asked for")
    };
    let analyst = PlanPreparer::new(pipeline::Settings {
        search: Search::irr(),
        ..pipeline::Settings::default()
    });
    let whole = prepared(analyst.clone());
    let cut = analyst.stopped_unless(|| false);
    let cut = prepared(cut);
    assert!(whole.includes(&cut) && whole != cut, "{cut:?}");
}

/// Watcher that halts after some boxes, and stores the last one.
struct Impatient {
    patience: usize,
    halt: StopRequest,
    last: Option<plan::DecoupledEnvelope>,
}

impl Observer for Impatient {
    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.patience == 0 {
            return ControlFlow::Break(self.halt);
        }
        ControlFlow::Continue(())
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Envelope(progress) = event {
            self.patience -= 1;
            self.last = Some(progress.envelope.clone());
        }
    }
}

#[test]
fn observer_follows_the_search_and_can_stop_it() {
    let (task, plan) = read("delivery");
    let request = EnvelopeRequest::new(&task, plan);
    for (patience, halt, stop) in [
        (1, StopRequest::Cancelled, Stop::Cancelled),
        (7, StopRequest::TimeLimit, Stop::TimeLimit),
    ] {
        let mut watcher = Impatient {
            patience,
            halt,
            last: None,
        };
        let outcome = envelope(&request, &mut watcher).expect("within exact reasoning");
        let EnvelopeFinding::Envelope { stop: found, .. } = outcome.answer.finding else {
            panic!("{:?}", outcome.answer)
        };
        assert_eq!(found, stop);
        assert_eq!(outcome.envelope, watcher.last, "it is the box seen last");
        let contains = elbowroom::write_box(
            &watcher.last.expect("seen"),
            &outcome.plan.expect("a valid plan"),
        );
        let inside = envelope_of(&EnvelopeRequest {
            contains: Some(contains),
            ..request.clone()
        });
        let is_inside = matches!(inside.answer.finding, EnvelopeFinding::Inside { .. });
        assert!(is_inside, "what was found is sound");
    }
    let mut watcher = Impatient {
        patience: 0,
        halt: StopRequest::Cancelled,
        last: None,
    };
    let outcome = envelope(&request, &mut watcher).expect("within exact reasoning");
    let expected = EnvelopeFinding::None {
        stop: Stop::Cancelled,
    };
    assert_eq!(outcome.answer.finding, expected);
    assert_stored(&outcome.answer);
}

/// The windows of a timeline are compared with those of the network at every corner of the box. For
/// a plan with this one deadline, the extremes are at the corners.
#[test]
fn timeline_windows_match_corners_of_the_box() {
    let (task, plan) = read("delivery");
    let outcome = envelope_of(&EnvelopeRequest::new(&task, plan));
    let EnvelopeFinding::Envelope { timeline, .. } = &outcome.answer.finding else {
        panic!("an envelope");
    };
    let timeline = timeline.as_ref().expect("a timeline");
    let (plan, envelope) = (
        outcome.plan.expect("a plan"),
        outcome.envelope.expect("a box"),
    );
    let ends = |interval: &Interval| {
        [&interval.lower, &interval.upper].map(|end| end.value().cloned().expect("a number"))
    };
    let ends: Vec<_> = envelope.intervals().iter().map(ends).collect();
    let mut widest = vec![None::<(Rational, Rational)>; plan.plan.nodes.len()];
    for corner in 0..1_usize << ends.len() {
        let values = ends.iter().enumerate();
        let values: Valuation = values
            .map(|(index, ends)| ends[corner >> index & 1].clone())
            .collect();
        let network = ConsistentNetwork::try_from(plan.plan.network(&values));
        let windows = network.expect("a schedule").windows(NodeId(0));
        for ((_, window), widest) in windows.iter().zip(&mut widest) {
            let earliest = window.earliest.clone().expect("after 0");
            let latest = window.latest.clone().expect("before the deadline");
            *widest = Some(match widest.take() {
                Some((low, high)) => (low.min(earliest), high.max(latest)),
                None => (earliest, latest),
            });
        }
    }
    for (node, what) in plan.plan.nodes() {
        let (action, window) = match what {
            Node::Start(id) => (id, &timeline.actions[id.index()].start_window),
            Node::End(id) => {
                let window = timeline.actions[id.index()].end_window.as_ref();
                (id, window.expect("it has an end"))
            }
            _ => continue,
        };
        let said = (&window.earliest, &window.latest);
        let (earliest, latest) = widest[node.index()].clone().expect("a window");
        let known = (Some(Exact(earliest)), Some(Exact(latest)));
        assert_eq!(said, (&known.0, &known.1), "{action:?}");
    }
}

/// The plan fills for 15 and drains for 10, after a separation of 0.001. The domain leaves both
/// durations to the executor.
#[test]
fn timeline_shows_chosen_durations_as_reported() {
    let (task, plan) = read("tank");
    let outcome = envelope_of(&EnvelopeRequest::new(&task, plan));
    let EnvelopeFinding::Envelope {
        timeline,
        makespans,
        ..
    } = &outcome.answer.finding
    else {
        panic!("an envelope");
    };
    let ends: Vec<Rational> = timeline
        .iter()
        .flat_map(|timeline| &timeline.actions)
        .filter_map(|action| Some(action.end.as_ref()?.0.clone()))
        .collect();
    let millis = |number: i64| Rational::from(number) / Rational::from(1000);
    assert_eq!(ends, [millis(15_000), millis(25_001)]);
    let makespans = makespans.as_ref().expect("a schedule");
    assert_eq!(makespans.nominal, millis(25_001));
}

#[test]
fn goal_parts_are_ordered_by_time_of_achievement() {
    let domain = "(define (domain d) (:requirements :durative-actions :numeric-fluents :timed-initial-literals)
        (:types thing) (:constants a b - thing)
        (:predicates (done ?x - thing) (whole) (open)) (:functions (n))
        (:durative-action long :parameters () :duration (= ?duration 9) :condition ()
            :effect (and (at end (done a)) (at start (increase (n) 1))))
        (:durative-action short :parameters () :duration (= ?duration 2) :condition ()
            :effect (and (at end (done b)) (at end (increase (n) 1)))))";
    let problem = "(define (problem p) (:domain d) (:init (whole) (= (n) 0) (at 5 (open)))
        (:goal (and (done a) (done b) (>= (n) 2) (open) (whole))))";
    let read = pddl::read_problem(
        &Source::new("domain", domain),
        &Source::new("problem", problem),
    );
    let task = std::sync::Arc::new(Task::new(read.expect("a problem without mistakes").0));
    let plan = Source::new("plan", "0: (long) [9]\n1: (short) [2]\n");
    let plan = pddl::read_plan(&plan, &task)
        .expect("a plan without mistakes")
        .0;
    let answer = check(&CheckRequest {
        task: &task,
        plan: Some(&plan),
        name: String::new(),
        settings: Settings::default(),
    });
    let Ok(CheckAnswer::Plan(checked)) = answer else {
        panic!("{answer:?}")
    };
    assert_stored(&checked);
    let CheckFinding::Valid { goals, .. } = checked.finding else {
        panic!("{:?}", checked.finding)
    };
    let goals = goals.iter().map(|it| format!("{} {}", it.time, it.goal));
    assert_eq!(
        goals.collect::<Vec<_>>(),
        [
            "0 (whole)",
            "3 (done b)",
            "3 (>= (n) 2)",
            "5 (open)",
            "9 (done a)"
        ]
    );
}
