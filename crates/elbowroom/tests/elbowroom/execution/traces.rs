//! Traces: the same run gives the same lines, and a truncated trace can be read.

use std::sync::Arc;

use elbowroom::execute::PlanPreparer;
use elbowroom::execution::{Command, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Replay, ReplayPlanner, ReplayWorld, Stored, TraceWriter};
use elbowroom::sim::SimWorld;
use serde_json::json;

use crate::execution::recorded::assert_as_recorded;
use crate::execution::scene::{EXECUTORS, Scene};

fn traced(scene: &Scene, executor: &str, seed: u64) -> String {
    traced_on_a_grid(scene, executor, seed, &Rational::new(1, 1000))
}

/// Returns the trace of a run in a world whose times are multiples of the grid.
fn traced_on_a_grid(scene: &Scene, executor: &str, seed: u64, grid: &Rational) -> String {
    let mut model = scene.world(
        "[[duration]]\naction = \"*\"\nnormal = { mean = 1, deviation = 0.3, minimum = 0.2 }\n\
         relative = true\n[[failure]]\naction = \"*\"\nprobability = 0.1\n",
    );
    model.resolution = grid.clone();
    let mut text = String::new();
    let mut sink = |line: &str| text.push_str(line);
    let mut writer = TraceWriter::new(Arc::clone(&scene.task), &mut sink);
    writer.header(&json!({})).expect("an object");
    let mut world = SimWorld::new(Arc::clone(&scene.task), &model, seed);
    let mut analyst = PlanPreparer::new(scene.flow.clone());
    scene.run_in(executor, &mut world, &mut analyst, &mut writer);
    text
}

/// Replays a trace. Returns the number of equal entries.
fn replayed(scene: &Scene, executor: &str, text: &str) -> usize {
    let stored = Stored::read(text).expect("a correct test");
    let mut replay = Replay::new(&stored, Arc::clone(&scene.task));
    scene
        .execution(executor)
        .with_planner(ReplayPlanner::new(&stored))
        .recorded_by(&mut replay)
        .run_in(&mut ReplayWorld::new(&stored, &scene.task));
    let (agreed, difference) = replay.outcome();
    assert_eq!(difference, None);
    agreed
}

#[test]
fn run_is_replayed_from_its_trace_alone() {
    let mut records = Vec::new();
    for scene in [Scene::case("delivery"), Scene::case("match")] {
        for executor in EXECUTORS.iter() {
            for seed in 0..5 {
                let text = traced(&scene, executor, seed);
                assert_eq!(text, traced(&scene, executor, seed));
                let agreed = replayed(&scene, executor, &text);
                assert_eq!(agreed + 1, text.lines().count(), "{executor}, {seed}");
                records.push(text.lines().map(str::to_owned).collect());
            }
        }
    }
    assert_as_recorded("traces", &records);
}

#[test]
fn truncated_trace_is_replayed() {
    let scene = Scene::case("delivery");
    let text = traced(&scene, "guarded", 1);
    let first = text.find('\n').expect("a correct test") + 1;
    for cut in (first..text.len()).step_by(997) {
        replayed(&scene, "guarded", &text[..cut]);
    }
}

/// Clocks of real worlds use floats. Each is read exactly as written.
#[test]
fn times_with_seventeen_digits_are_replayed_exactly() {
    let scene = Scene::case("delivery");
    let mut longest = 0;
    for (seed, grid) in (0..20).zip([7_654_321, 3_000_017, 999_983].into_iter().cycle()) {
        let text = traced_on_a_grid(&scene, "guarded", seed, &Rational::new(1, grid));
        let agreed = replayed(&scene, "guarded", &text);
        assert_eq!(agreed + 1, text.lines().count(), "{seed}");
        let decimals = text.split("\"decimal\":").skip(1);
        let digits = decimals.map(|rest| rest.find([',', '}']).unwrap_or(0));
        longest = longest.max(digits.max().unwrap_or(0));
    }
    assert!(longest >= 17, "the floats are awkward: {longest}");
}

/// World that fails at its nth call, including commands.
struct FailingWorld<W> {
    inner: W,
    remaining_calls: usize,
}

impl<W> FailingWorld<W> {
    fn count_call(&mut self) -> Result<(), WorldError> {
        self.remaining_calls = self
            .remaining_calls
            .checked_sub(1)
            .ok_or_else(|| WorldError::new("it has fallen off the table"))?;
        Ok(())
    }
}

impl<W: World> World for FailingWorld<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.count_call()?;
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.count_call()?;
        self.inner.wait(until)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.count_call()?;
        self.inner.look(facts, fluents)
    }
}

/// If a world fails, the trace replays to the same end with the same message.
#[test]
fn run_with_failed_world_replays_to_same_end() {
    for scene in [Scene::case("delivery"), Scene::case("match")] {
        let mut failed = 0;
        for lives in 0..60 {
            let model = scene.world("");
            let mut text = String::new();
            let mut sink = |line: &str| text.push_str(line);
            let mut writer = TraceWriter::new(Arc::clone(&scene.task), &mut sink);
            writer.header(&json!({})).expect("an object");
            let mut world = FailingWorld {
                inner: SimWorld::new(Arc::clone(&scene.task), &model, 1),
                remaining_calls: lives,
            };
            let mut analyst = PlanPreparer::new(scene.flow.clone());
            scene.run_in("guarded", &mut world, &mut analyst, &mut writer);
            let last = text.lines().last().expect("it is over");
            failed += usize::from(last.contains("it has fallen off the table"));
            let agreed = replayed(&scene, "guarded", &text);
            assert_eq!(agreed + 1, text.lines().count(), "{lives}: {last}");
        }
        assert!(failed > 5, "{failed}");
    }
}
