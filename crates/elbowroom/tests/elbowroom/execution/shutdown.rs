//! End of a run: no action keeps running, no event is lost, and a dead end has a reason.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use elbowroom::execution::run::{Report, Verdict};
use elbowroom::execution::{
    Cause, Command, Ending, Event, Evidence, NoPlanner, NoRecord, Observation, Planner, Recorder,
    TimeAdvance, World, WorldError,
};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Replay, ReplayPlanner, ReplayWorld, Stored, TraceWriter};
use elbowroom::sim::{SimWorld, WorldModel};
use serde_json::json;

use crate::execution::scene::{EXECUTORS, Scene};

/// Two independent robots, and a lamp that may be switched off.
const ROBOTS: &str = "(define (domain robots)
    (:requirements :durative-actions :negative-preconditions :timed-initial-literals)
    (:predicates (lamp) (carried) (picked) (shelved) (open) (lit))
    (:durative-action carry :parameters () :duration (= ?duration 100)
      :condition () :effect (at end (carried)))
    (:durative-action pick :parameters () :duration (= ?duration 10)
      :condition (at start (shelved))
      :effect (and (at start (not (shelved))) (at end (picked))))
    (:durative-action fetch :parameters () :duration (= ?duration 10)
      :condition (and (at start (carried)) (at start (shelved))) :effect (at end (picked)))
    (:durative-action switch :parameters () :duration (= ?duration 1)
      :condition () :effect (at end (lamp)))
    (:durative-action sort :parameters () :duration (= ?duration 10)
      :condition (and (at start (open)) (over all (lamp))) :effect (at end (lit))))";

fn robots(init: &str, goal: &str, plan: &str) -> Scene {
    let problem = format!("(define (problem p) (:domain robots) (:init {init}) (:goal {goal}))");
    Scene::new(ROBOTS, &problem, Some(plan))
}

const BOTH: &str = "0: (carry) [100]\n0: (pick) [10]";

/// Runs with explanations, until the run is asked to end.
fn run(
    scene: &Scene,
    executor: &str,
    world: &mut dyn World,
    planner: &mut dyn Planner,
    recorder: &mut dyn Recorder,
    must_end: &(dyn Fn() -> bool + Sync),
) -> Report {
    scene
        .execution(executor)
        .with_planner(planner)
        .recorded_by(recorder)
        .with_explanations()
        .with_stop_check(must_end)
        .run_in(world)
}

/// Runs in a simulated world. Returns the report, and the number of running actions at the end.
fn simulated(scene: &Scene, executor: &str, model: &WorldModel, plans: bool) -> (Report, usize) {
    let mut world = SimWorld::new(Arc::clone(&scene.task), model, 0);
    let report = if plans {
        let mut planner = scene.planner();
        run(
            scene,
            executor,
            &mut world,
            &mut planner,
            &mut NoRecord,
            &|| false,
        )
    } else {
        run(
            scene,
            executor,
            &mut world,
            &mut NoPlanner,
            &mut NoRecord,
            &|| false,
        )
    };
    let running = world.truth().running().len();
    (report, running)
}

fn endings(report: &Report) -> Vec<(&str, Option<&str>)> {
    let steps = report.executed.iter();
    steps
        .map(|it| {
            let name = it.step.action.name.as_str();
            (name, it.ending.as_ref().map(Ending::name))
        })
        .collect()
}

#[test]
fn a_failed_pick_does_not_cancel_the_other_robots_drive() {
    let scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    // The first attempt fails before its start.
    let model =
        scene.world("[[failure]]\naction = \"pick\"\nprobability = 0.5\nwhen = \"start\"\n");
    for executor in EXECUTORS.iter() {
        let mut replans = 0;
        for seed in 0..20 {
            let report = scene.run(executor, &model, seed);
            assert_eq!(
                report.verdict,
                Verdict::GoalReached,
                "{executor}: {report:#?}"
            );
            let carries = endings(&report);
            let carries: Vec<_> = carries.iter().filter(|it| it.0 == "(carry)").collect();
            assert_eq!(carries, [&("(carry)", Some("succeeded"))], "{executor}");
            replans += report.replans;
        }
        // Executors with retries need no new plan.
        let retries = ["esterel", "adaptable", "lookahead"].contains(executor);
        assert!(replans > 0 || retries, "{executor}");
    }
}

#[test]
fn planner_failure_cancels_running_actions() {
    let scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    let model = scene.world("[[failure]]\naction = \"pick\"\nprobability = 1\nwhen = \"end\"\n");
    for executor in EXECUTORS.iter() {
        let (report, running) = simulated(&scene, executor, &model, false);
        assert!(
            matches!(report.verdict, Verdict::NoPlan { .. }),
            "{executor}: {report:#?}"
        );
        assert_eq!(running, 0, "{executor}");
        let all = endings(&report);
        assert!(
            all.iter().all(|(_, ending)| ending.is_some()),
            "{executor}: {all:?}"
        );
        // Executors based on orders first execute the remaining steps of the plan.
        let gives_up = !["adaptable", "lookahead"].contains(executor);
        let is_cancelled = all.contains(&("(carry)", Some("cancelled")));
        assert!(is_cancelled || !gives_up, "{executor}: {all:?}");
    }
}

#[test]
fn time_limit_or_replan_limit_cancels_running_actions() {
    let mut scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    scene.settings.time_limit = Rational::from(50);
    let model = WorldModel::without_deviations();
    let (report, running) = simulated(&scene, "stn", &model, true);
    assert_eq!((&report.verdict, running), (&Verdict::TimeLimit, 0));
    assert_eq!(endings(&report)[0], ("(carry)", Some("cancelled")));
    scene.settings.time_limit = Rational::from(100_000);
    scene.settings.max_replans = 0;
    let model = scene.world("[[failure]]\naction = \"pick\"\nprobability = 1\nwhen = \"end\"\n");
    let (report, running) = simulated(&scene, "stn", &model, true);
    assert_eq!((&report.verdict, running), (&Verdict::ReplanLimit, 0));
    assert_eq!(endings(&report)[0], ("(carry)", Some("cancelled")));
}

/// The failed pick has left the parcel neither on the shelf nor in the hand.
#[test]
fn dead_end_names_unreachable_fact_and_time() {
    let scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    let model = scene.world("[[failure]]\naction = \"pick\"\nprobability = 1\nwhen = \"end\"\n");
    let (report, running) = simulated(&scene, "guarded", &model, true);
    assert_eq!((&report.verdict, running), (&Verdict::Unsolvable, 0));
    let [reason] = report.dead_end.as_slice() else {
        panic!("{:#?}", report.dead_end);
    };
    assert_eq!(reason.cause, Cause::NeverAgain);
    assert_eq!(
        reason.to_string(),
        "(picked) can never become true again, since 10 (cause: (pick) failed: it broke \
         down)"
    );
}

#[test]
fn dead_end_is_detected_for_every_cause() {
    let plan = "0: (carry) [100]\n100.001: (fetch) [10]";
    let scene = robots("(shelved)", "(and (carried) (picked))", plan);
    let model = scene.world("[[event]]\nfact = \"(shelved)\"\nbecomes = false\nconstant = 30\n");
    let (report, _) = simulated(&scene, "stn", &model, true);
    let [reason] = report.dead_end.as_slice() else {
        panic!("{report:#?}");
    };
    assert_eq!(reason.since, Some(Rational::from(30)));
    let seen = Evidence::Fact {
        fact: "(shelved)".to_owned(),
        truth: false,
    };
    assert_eq!(reason.evidence, [seen]);

    // `esterel` does not monitor the closing of the shop.
    let plan = "0: (pick) [10]\n10.001: (sort) [10]";
    let init = "(shelved) (open) (lamp) (at 25 (not (open)))";
    let scene = robots(init, "(and (picked) (lit))", plan);
    let model = scene.world(
        "[[duration]]\naction = \"pick\"\nconstant = 40\n\
         [[failure]]\naction = \"sort\"\nprobability = 1\nwhen = \"start\"\n",
    );
    let (report, _) = simulated(&scene, "esterel", &model, true);
    let reasons = report.dead_end.iter().map(ToString::to_string);
    let reasons: Vec<_> = reasons.collect();
    if !reasons.is_empty() {
        assert_eq!(
            reasons,
            ["(lit) can never become true again, since 25 (cause: (open) became false)"]
        );
    }
    assert_ne!(report.verdict, Verdict::GoalReached);
}

/// The run is asked to end at each possible time, with every executor.
#[test]
fn stopped_run_shuts_down_and_replays() {
    let scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    let model =
        scene.world("[[failure]]\naction = \"pick\"\nprobability = 0.5\nwhen = \"start\"\n");
    for executor in ["fixed:30", "stn", "guarded", "live", "esterel"] {
        for limit in 0..12 {
            let asked = AtomicUsize::new(0);
            let must_end = || asked.fetch_add(1, Ordering::SeqCst) + 1 > limit;
            let mut text = String::new();
            let mut sink = |line: &str| text.push_str(line);
            let mut writer = TraceWriter::new(Arc::clone(&scene.task), &mut sink);
            writer.header(&json!({})).expect("an object");
            let mut world = SimWorld::new(Arc::clone(&scene.task), &model, 1);
            let mut planner = scene.planner();
            let report = run(
                &scene,
                executor,
                &mut world,
                &mut planner,
                &mut writer,
                &must_end,
            );
            if report.verdict == Verdict::GoalReached {
                continue;
            }
            assert_eq!(report.verdict, Verdict::Interrupted, "{executor}, {limit}");
            assert!(world.truth().running().is_empty(), "{executor}, {limit}");
            let open = report.executed.iter().filter(|it| it.ending.is_none());
            assert_eq!(open.count(), 0, "{executor}, {limit}: {report:#?}");
            // A late success still counts.
            assert!(text.contains("\"verdict\":\"interrupted\""), "{text}");

            let stored = Stored::read(&text).expect("a correct test");
            let mut replay = Replay::new(&stored, Arc::clone(&scene.task));
            let interruption = replay.interruption();
            let again = run(
                &scene,
                executor,
                &mut ReplayWorld::new(&stored, &scene.task),
                &mut ReplayPlanner::new(&stored),
                &mut replay,
                &|| interruption.load(Ordering::SeqCst),
            );
            let (agreed, difference) = replay.outcome();
            assert_eq!(difference, None, "{executor}, {limit}");
            assert_eq!(agreed + 1, text.lines().count(), "{executor}, {limit}");
            assert_eq!(again.verdict, Verdict::Interrupted);
        }
    }
}

/// World whose cancelled actions stop with a delay, or never.
struct Sluggish<'a> {
    inner: SimWorld<'a>,
    stops_after: Option<i64>,
    stopping: Vec<(Rational, Command)>,
}

impl World for Sluggish<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match (command, self.stops_after) {
            (Command::Cancel { .. }, Some(seconds)) => {
                let time = now + Rational::from(seconds);
                self.stopping.push((time, command.clone()));
                Ok(())
            }
            (Command::Cancel { .. }, None) => Ok(()),
            _ => self.inner.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let Some((time, command)) = self.stopping.first().cloned() else {
            return self.inner.wait(until);
        };
        let passage = self.inner.wait(until.min(&time))?;
        if passage.now < time || !passage.observations.is_empty() {
            return Ok(passage);
        }
        self.stopping.remove(0);
        self.inner.command(&time, &command)?;
        self.inner.wait(&time)
    }
}

#[test]
fn cancelled_actions_get_a_shutdown_grace_period() {
    let scene = robots("(shelved)", "(and (carried) (picked))", BOTH);
    let model = scene.world("[[failure]]\naction = \"pick\"\nprobability = 1\nwhen = \"end\"\n");
    for (stops_after, ending, time) in [
        (Some(2), Some("cancelled"), 12),
        (Some(60), None, 15),
        (None, None, 15),
    ] {
        let inner = SimWorld::new(Arc::clone(&scene.task), &model, 0);
        let mut world = Sluggish {
            inner,
            stops_after,
            stopping: Vec::new(),
        };
        let report = run(
            &scene,
            "stn",
            &mut world,
            &mut NoPlanner,
            &mut NoRecord,
            &|| false,
        );
        assert!(
            matches!(report.verdict, Verdict::NoPlan { .. }),
            "{report:#?}"
        );
        assert_eq!(endings(&report)[0], ("(carry)", ending), "{stops_after:?}");
        assert_eq!(report.time, Rational::from(time), "{stops_after:?}");
    }
}

/// World that never reports a failure.
struct Silent<'a>(SimWorld<'a>);

impl World for Silent<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.0.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut passage = self.0.wait(until)?;
        let is_told = |it: &Observation| {
            let ending = match &it.event {
                Event::Ended { ending, .. } => Some(ending),
                _ => None,
            };
            !matches!(ending, Some(Ending::Failed { .. }))
        };
        passage.observations.retain(is_told);
        Ok(passage)
    }
}

/// The lamp goes out during sorting. Every plan can continue with the carrying, and none with the
/// sorting.
#[test]
fn hopeless_running_action_is_cancelled() {
    let plan = "0: (carry) [100]\n0: (sort) [10]";
    let scene = robots("(open) (lamp) (shelved)", "(and (carried) (lit))", plan);
    let model = scene.world("[[event]]\nfact = \"(lamp)\"\nbecomes = false\nconstant = 5\n");
    for executor in ["stn", "guarded", "live"] {
        let mut world = Silent(SimWorld::new(Arc::clone(&scene.task), &model, 0));
        let mut planner = scene.planner();
        let report = run(
            &scene,
            executor,
            &mut world,
            &mut planner,
            &mut NoRecord,
            &|| false,
        );
        assert_eq!(
            report.verdict,
            Verdict::GoalReached,
            "{executor}: {report:#?}"
        );
        let all = endings(&report);
        assert_eq!(
            all[..2],
            [
                ("(carry)", Some("succeeded")),
                ("(sort)", Some("cancelled"))
            ],
            "{executor}"
        );
    }
}
