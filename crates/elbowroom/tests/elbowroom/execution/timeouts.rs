//! Time-outs: an action that stays inside its interval and ends by its time-out is never cancelled.
//! An action without progress is cancelled at its time-out, after a warning.

use std::sync::{Arc, Mutex};

use elbowroom::answers::NoObserver;
use elbowroom::answers::envelope::{EnvelopeFinding, EnvelopeRequest, NominalFailure, envelope};
use elbowroom::execute::PlanPreparer;
use elbowroom::execution::run::{Report, TimeoutRule, Verdict};
use elbowroom::execution::{Cause, Command, Entry, Recorder, WarningCause};
use elbowroom::num::Rational;
use elbowroom::sim::SimWorld;

use crate::execution::scene::Scene;

/// Two actions in a row, without any deadline.
const DOMAIN: &str = "(define (domain two)
    (:requirements :durative-actions)
    (:predicates (a) (b))
    (:durative-action first :parameters () :duration (= ?duration 2)
      :condition (and) :effect (at end (a)))
    (:durative-action second :parameters () :duration (= ?duration 5)
      :condition (at start (a)) :effect (at end (b))))";
const PROBLEM: &str = "(define (problem p) (:domain two) (:init) (:goal (and (a) (b))))";
const PLAN: &str = "0: (first) [2]\n2.001: (second) [5]\n";

/// A warning: the action, the time of the warning, and the time-out.
type Warned = (String, Rational, Rational);

/// Warnings of time-outs, and times of cancellations.
#[derive(Clone, Default)]
struct Noted {
    warnings: Arc<Mutex<Vec<Warned>>>,
    cancelled: Arc<Mutex<Vec<Rational>>>,
}

impl Recorder for Noted {
    fn record(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::Warning {
                now,
                action,
                until,
                cause: WarningCause::Timeout,
                ..
            } => {
                let warning = ((*action).to_owned(), (*now).clone(), (*until).clone());
                self.warnings.lock().expect("no panic").push(warning);
            }
            Entry::Command {
                now,
                command: Command::Cancel { .. },
                ..
            } => {
                let mut cancelled = self.cancelled.lock().expect("no panic");
                cancelled.push((*now).clone());
            }
            _ => {}
        }
    }
}

impl Noted {
    fn warnings(&self) -> Vec<Warned> {
        self.warnings.lock().expect("no panic").clone()
    }

    fn cancelled(&self) -> Vec<Rational> {
        self.cancelled.lock().expect("no panic").clone()
    }
}

fn scene(timeout: &str) -> Scene {
    let mut scene = Scene::new(DOMAIN, PROBLEM, Some(PLAN));
    let rule: TimeoutRule = timeout.parse().expect("a correct test");
    scene.settings.timeout = rule.clone();
    scene.settings.max_replans = 0;
    scene.flow.timeout = rule;
    scene
}

/// Runs the plan in a world with this duration of `(first)`.
fn run(scene: &Scene, executor: &str, takes: &str) -> (Report, Noted) {
    let model = scene.world(&format!(
        "[[duration]]\naction = \"first\"\nconstant = {takes}\n"
    ));
    let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 0);
    let mut noted = Noted::default();
    let mut analyst = PlanPreparer::new(scene.flow.clone());
    let report = scene.run_in(executor, &mut world, &mut analyst, &mut noted);
    (report, noted)
}

fn number(text: &str) -> Rational {
    text.parse().expect("a correct test")
}

#[test]
fn action_ending_before_time_out_is_not_cancelled() {
    // The warning comes after three quarters of the time between the planned end and the time-out.
    for (timeout, takes, limit, warned) in [
        ("10x,600", "600", "600", "450.5"),
        ("60", "60", "60", "45.5"),
        ("5x,8", "10", "10", "8"),
    ] {
        let scene = scene(timeout);
        for executor in ["guarded", "live"] {
            let (report, noted) = run(&scene, executor, takes);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor}: {report:#?}"
            );
            assert_eq!(report.replans, 0, "{executor}");
            let warning = ("(first)".to_owned(), number(warned), number(limit));
            assert_eq!(noted.warnings(), [warning], "{executor}, {timeout}");
            assert_eq!(noted.cancelled(), [], "{executor}");
        }
    }
}

#[test]
fn action_exceeding_time_out_is_cancelled_after_warning() {
    let scene = scene("60");
    for executor in ["guarded", "live"] {
        let (report, noted) = run(&scene, executor, "61");
        let warning = ("(first)".to_owned(), number("45.5"), number("60"));
        assert_eq!(noted.warnings(), [warning], "{executor}");
        assert_eq!(
            noted.cancelled(),
            [number("60.001")],
            "{executor}: {report:#?}"
        );
        assert_ne!(report.verdict, Verdict::GoalReached, "{executor}");
        let causes: Vec<Cause> = report.reasons.iter().map(|reason| reason.cause).collect();
        assert_eq!(causes, [Cause::Silence], "{executor}: {report:#?}");
    }
}

#[test]
fn action_without_time_out_may_take_very_long() {
    let scene = scene("none");
    for executor in ["guarded", "live"] {
        let (report, noted) = run(&scene, executor, "2000");
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        assert_eq!(noted.warnings(), [], "{executor}");
    }
}

#[test]
fn finite_interval_does_not_extend_the_time_out() {
    let domain = DOMAIN.replace("(:predicates (a) (b))", "(:predicates (a) (b) (open))");
    let domain = domain.replace(":condition (and)", ":condition (at end (open))");
    let problem = "(define (problem p) (:domain two)
        (:init (open) (at 5000 (not (open)))) (:goal (and (a) (b))))";
    let mut scene = Scene::new(&domain, problem, Some(PLAN));
    scene.settings.max_replans = 0;
    let (report, noted) = run(&scene, "guarded", "599");
    assert_eq!(report.verdict, Verdict::GoalReached, "{report:#?}");
    assert_eq!(noted.cancelled(), []);
    let (_, noted) = run(&scene, "guarded", "601");
    assert_eq!(noted.cancelled(), [number("600.001")]);
}

/// Returns the answer about the plan, or about a box.
fn finding(scene: &Scene, contains: Option<&str>) -> EnvelopeFinding {
    let request = EnvelopeRequest::new(&scene.task, scene.plan.clone());
    let request = EnvelopeRequest {
        contains: contains.map(str::to_owned),
        ..request.with_settings(&scene.flow)
    };
    let outcome = envelope(&request, &mut NoObserver).expect("within exact analysis");
    outcome.answer.finding
}

#[test]
fn answer_has_the_time_out_of_each_action() {
    let time_outs = |timeout| {
        let EnvelopeFinding::Envelope { parameters, .. } = finding(&scene(timeout), None) else {
            panic!("an envelope");
        };
        let time_outs = parameters.into_iter().map(|room| room.range.timeout);
        time_outs.collect::<Vec<_>>()
    };
    let exactly = |text| Some(number(text));
    assert_eq!(time_outs("10x,600"), [exactly("600"), exactly("600")]);
    assert_eq!(time_outs("10x,30"), [exactly("30"), exactly("50")]);
    assert_eq!(time_outs("400"), [exactly("400"), exactly("400")]);
    assert_eq!(time_outs("none"), [None, None]);
}

#[test]
fn box_beyond_a_time_out_is_rejected() {
    let is_inside = |timeout: &str, contains: &str| {
        let finding = finding(&scene(timeout), Some(contains));
        match finding {
            EnvelopeFinding::Inside { .. } => true,
            EnvelopeFinding::Outside { counterexample, .. } => {
                let message = &counterexample.message;
                assert!(message.contains("times out after"), "{message}");
                false
            }
            other => panic!("{other:?}"),
        }
    };
    assert!(is_inside("10x,600", "dur_0=[1,600]"));
    assert!(!is_inside("10x,600", "dur_0=[1,600.001]"));
    assert!(!is_inside("10x,600", "dur_0=[1,inf]"));
    assert!(is_inside("none", "dur_0=[1,inf]"));
    assert!(is_inside("1000", "dur_0=[1,1000] dur_1=[1,1000]"));
    assert!(!is_inside("1000", "dur_1=[1,1001]"));
}

#[test]
fn plan_that_takes_longer_than_a_time_out_has_no_envelope_and_no_run() {
    let scene = scene("4");
    let failing = match finding(&scene, None) {
        EnvelopeFinding::Fails(NominalFailure::AsPlanned { counterexample, .. }) => counterexample,
        other => panic!("{other:?}"),
    };
    assert!(
        failing
            .message
            .contains("(second) is planned to take 5, but times out after 4"),
        "{}",
        failing.message
    );
    let (report, _) = run(&scene, "guarded", "2");
    match &report.verdict {
        Verdict::NoPlan { why, .. } => assert_eq!(*why, failing.message),
        other => panic!("{other:?}"),
    }
}

#[test]
fn action_specific_rule_sets_its_time_out() {
    for (timeout, limit) in [
        ("10x,600; first=30; second=7", "30"),
        ("none;(FIRST)=40; first=30", "40"),
        ("first=4x,1", "8"),
    ] {
        let scene = scene(timeout);
        for executor in ["guarded", "live"] {
            let (report, _) = run(&scene, executor, limit);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor}: {timeout}"
            );
            let (report, noted) = run(&scene, executor, "1000");
            assert_ne!(
                report.verdict,
                Verdict::GoalReached,
                "{executor}: {timeout}"
            );
            let cancelled = noted.cancelled.lock().expect("no panic");
            let first = cancelled.first().expect("it is cancelled");
            assert_eq!(
                *first,
                number(limit) + number("0.001"),
                "{executor}: {timeout}"
            );
        }
    }
}

#[test]
fn rule_for_an_unknown_action_is_refused() {
    for (timeout, unknown) in [("third=5", "third"), ("(first a)=5", "(first a)")] {
        let scene = scene(timeout);
        let request = EnvelopeRequest::new(&scene.task, scene.plan.clone());
        let request = request.with_settings(&scene.flow);
        let refused = envelope(&request, &mut NoObserver).expect_err(timeout);
        assert!(refused.to_string().contains(unknown), "{refused}");
    }
}

#[test]
fn time_out_rule_round_trips() {
    for text in [
        "none",
        "600",
        "10x,600",
        "5/2x,1/3",
        "0x,3",
        "drive=none; (pick a b)=2.5x,1",
    ] {
        let rule: TimeoutRule = text.parse().expect("a rule");
        assert_eq!(rule.to_string().parse(), Ok(rule), "{text}");
    }
    for text in [
        "",
        "0",
        "-5",
        "10x",
        "10x,0",
        "-1x,5",
        "x,5",
        "10x,600,3",
        "None",
        "inf",
        "5; drive",
        "drive=",
        "=5",
        "drive=5; drive=6",
        "drive a=5",
        "(drive a=5",
        "()=5",
        "drive=5;",
    ] {
        let error = text.parse::<TimeoutRule>().expect_err(text);
        assert!(error.to_string().contains("a time-out"), "{error}");
    }
}
