//! A run that is driven step by step has the same decisions as a blocking one.

use std::sync::Arc;

use elbowroom::execute::{
    CachingPlanner, CachingPreparer, Embedded, ExactRegion, Execution, External,
    MostProbablePlanner, PlanPreparer, SharedMostProbablePlanner,
};
use elbowroom::execution::run::{Next, Report, Run, UnexpectedAnswer, Verdict};
use elbowroom::execution::{
    Answer, Command, Executor, PlanAnswer, PlannerAnswer, RequestId, TimeAdvance, Urgency, Workers,
    World, WorldError,
};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Replay, ReplayPlanner, ReplayWorld, Stored, TraceWriter};
use elbowroom::sim::{FaultInjector, SimWorld};

use crate::execution::scene::{EXECUTORS, Scene};

/// An event loop keeps these between steps, and may move them to another thread.
#[test]
fn assembled_parts_are_send() {
    fn is_send<T: Send + ?Sized>() {}
    is_send::<Run<'static>>();
    is_send::<Execution<'static>>();
    is_send::<Box<dyn Executor>>();
    is_send::<Box<dyn World>>();
    is_send::<(
        PlanPreparer,
        ExactRegion,
        Embedded<'static>,
        External<'static>,
    )>();
    is_send::<(MostProbablePlanner<'static>, SharedMostProbablePlanner)>();
    is_send::<(
        CachingPlanner<Embedded<'static>>,
        CachingPreparer<PlanPreparer<'static>>,
    )>();
    is_send::<(SimWorld<'static>, FaultInjector<SimWorld<'static>>)>();
    is_send::<(TraceWriter<'static>, Replay, ReplayWorld, ReplayPlanner)>();
    is_send::<(elbowroom::envelope::Oracle, elbowroom::model::Task)>();
}

/// Returns the next question to the world; the workers answer the others.
fn next_of_the_world(run: &mut Run<'_>, workers: &mut dyn Workers) -> Next {
    loop {
        match run.next() {
            request @ (Next::Plan(_) | Next::Prepare(_) | Next::Abandon(_)) => {
                run.delegate(request, workers);
            }
            next => return next,
        }
    }
}

/// Drives a run as an event loop would, and asks each question twice.
fn driven(mut run: Run<'_>, world: &mut dyn World, workers: &mut dyn Workers) -> Report {
    loop {
        let next = run.next();
        let is_repeated = match &next {
            Next::Command(_) | Next::Abandon(_) => false,
            Next::Plan(request) => request.urgency == Urgency::Awaited,
            Next::Prepare(request) => request.urgency == Urgency::Awaited,
            _ => true,
        };
        if is_repeated {
            assert_eq!(run.next(), next, "the question is still open");
        }
        let answer = match next {
            Next::Command(command) => world.command(&run.now().clone(), &command),
            Next::Wait { until } => world.wait(&until).map(|passage| {
                assert!(
                    run.observe_requested(Vec::new()).is_err(),
                    "a wait is no look"
                );
                run.observe(passage).expect("it was asked for");
            }),
            Next::Look { facts, fluents } => world.look(&facts, &fluents).map(|seen| {
                let (now, observations) = (run.now().clone(), Vec::new());
                assert!(run.observe(TimeAdvance { now, observations }).is_err());
                run.observe_requested(seen).expect("it was asked for");
            }),
            Next::Over(report) => return report,
            request => {
                run.delegate(request, workers);
                Ok(())
            }
        };
        if let Err(error) = answer {
            run.fail(error);
        }
    }
}

#[test]
fn event_loop_and_blocking_world_lead_to_same_decisions() {
    let scene = Scene::case("delivery");
    let mut model = scene.world(
        "[[duration]]\naction = \"*\"\nnormal = { mean = 1.1, deviation = 0.4, minimum = 0.2 }\n\
         relative = true\n[[failure]]\naction = \"*\"\nprobability = 0.2\n",
    );
    model.reports.late = 0.2;
    model.reports.duplicated = 0.1;
    for executor in EXECUTORS.iter() {
        for seed in 0..4 {
            let traced = |drive: &dyn Fn(Run<'_>, &mut dyn World, &mut dyn Workers) -> Report| {
                let mut text = String::new();
                let mut sink = |line: &str| text.push_str(line);
                let mut writer = TraceWriter::new(Arc::clone(&scene.task), &mut sink);
                let execution = scene.execution(executor).recorded_by(&mut writer);
                let (run, mut workers) = execution.run();
                let world = &mut *model.world(&scene.task, seed);
                let report = drive(run, world, &mut *workers);
                drop(workers);
                (report, text)
            };
            let blocking = traced(&|run, world, workers| run.run_to_end(world, workers));
            assert_eq!(traced(&driven), blocking, "{executor}, {seed}");
        }
    }
}

#[test]
fn finished_run_stays_finished() {
    let scene = Scene::case("delivery");
    let (mut run, mut workers) = scene.execution("stn").run();
    let Next::Command(_) = next_of_the_world(&mut run, &mut *workers) else {
        panic!("the plan begins with a start");
    };
    run.fail(WorldError::new("the robot fell over"));
    let Next::Over(report) = run.next() else {
        panic!("nobody can be told anything any more");
    };
    let why = "the robot fell over".to_owned();
    assert_eq!(report.verdict, Verdict::WorldFailed { why });
    run.fail(WorldError::new("it fell over again"));
    assert_eq!(run.next(), Next::Over(report));
}

/// World that fails at one call, but can still receive commands.
struct Stumbling<'w> {
    inner: Box<dyn World + 'w>,
    /// Number of calls before the failure.
    calls_before_failure: Option<usize>,
}

impl Stumbling<'_> {
    fn pass_call(&mut self) -> Result<(), WorldError> {
        match self.calls_before_failure {
            Some(0) => {
                self.calls_before_failure = None;
                Err(WorldError::new("it stumbled").reachable())
            }
            left => {
                self.calls_before_failure = left.map(|left| left - 1);
                Ok(())
            }
        }
    }
}

impl World for Stumbling<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.pass_call()?;
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.pass_call()?;
        self.inner.wait(until)
    }
}

#[test]
fn reachable_world_that_failed_is_cancelled_and_replayed() {
    let scene = Scene::case("delivery");
    let model = scene.world("");
    let header = r#"{"event":"header","format":"elbowroom-trace","version":1}"#;
    let mut failures = 0;
    for executor in EXECUTORS.iter() {
        for left in 0..12 {
            let mut text = format!("{header}\n");
            let mut sink = |line: &str| text.push_str(line);
            let mut writer = TraceWriter::new(Arc::clone(&scene.task), &mut sink);
            let mut world = Stumbling {
                inner: model.world(&scene.task, 0),
                calls_before_failure: Some(left),
            };
            let execution = scene.execution(executor).recorded_by(&mut writer);
            let report = execution.run_in(&mut world);
            if report.verdict == Verdict::GoalReached {
                continue;
            }
            let why = "it stumbled".to_owned();
            assert_eq!(report.verdict, Verdict::WorldFailed { why });
            failures += 1;
            assert!(text.contains("\"event\":\"world-failed\""), "{text}");
            let running = report.executed.iter().filter(|it| it.ending.is_none());
            assert_eq!(running.count(), 0, "{executor}, {left}");

            let stored = Stored::read(&text).expect("a trace");
            let mut replay = Replay::new(&stored, Arc::clone(&scene.task));
            let execution = scene.execution(executor);
            execution
                .with_planner(ReplayPlanner::new(&stored))
                .recorded_by(&mut replay)
                .run_in(&mut ReplayWorld::new(&stored, &scene.task));
            let (agreed, difference) = replay.outcome();
            assert_eq!(difference, None, "{executor}, {left}");
            assert_eq!(agreed, stored.lines.len(), "{executor}, {left}");
        }
    }
    assert!(failures > EXECUTORS.len(), "{failures}");
}

#[test]
fn unrequested_input_is_rejected_without_effect() {
    let scene = Scene::case("delivery");
    let ((mut run, mut workers), mut world) = (scene.execution("stn").run(), Vec::new());
    let early = TimeAdvance {
        now: Rational::from(1_000_000),
        observations: Vec::new(),
    };
    let refused: Result<(), UnexpectedAnswer> = run.observe(early);
    let words = refused.expect_err("nothing was asked").to_string();
    assert!(words.contains("has not requested time to pass"), "{words}");
    while let Next::Command(command) = next_of_the_world(&mut run, &mut *workers) {
        world.push(command);
    }
    assert_eq!(*run.now(), Rational::ZERO);
    assert!(!world.is_empty());
}

#[test]
fn answers_to_unknown_requests_change_nothing() {
    let scene = Scene::case("delivery");
    let (mut run, mut workers) = scene.execution("stn").run();
    let Next::Prepare(request) = run.next() else {
        panic!("the given plan is prepared first");
    };
    assert_eq!(request.urgency, Urgency::Awaited);
    let other = RequestId(request.id.0 + 1);
    let no_plan = || PlannerAnswer::from(PlanAnswer::NoPlanner);
    // Answers of another kind, and with another identifier.
    run.planned(request.id, no_plan());
    run.answer(Answer::Planned(other, no_plan()));
    let mission = workers.prepare(&request).expect("answered at once");
    run.prepared(other, mission.clone());
    assert_eq!(run.next(), Next::Prepare(request.clone()));
    run.prepared(request.id, mission.clone());
    let command = run.next();
    assert!(matches!(command, Next::Command(_)), "{command:?}");
    // A repeated answer.
    run.prepared(request.id, mission);
    assert!(matches!(run.next(), Next::Command(_) | Next::Wait { .. }));
}
