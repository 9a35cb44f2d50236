//! Fixtures for tests of planning in the background. There are no threads and no clock: the planner
//! takes a given time of the world, and the world reports when the plan is ready.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::execute::{Embedded, Execution, PlanPreparer};
use elbowroom::execution::run::{Report, RunSettings};
use elbowroom::execution::{
    Command, Entry, Event, Observation, PlanAnswer, PlanForm, Planner, PlannerAnswer,
    PreparationRequest, PreparationResult, PrepareError, Preparer, Recorder, TimeAdvance, World,
    WorldError,
};
use elbowroom::model::{Situation, Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::pipeline;
use elbowroom::report::trace::Line;

use crate::execution::persistent::scripted::{Notes, ScriptedWorld};

/// Planner in the background of a run.
#[derive(Clone, Default)]
pub(crate) struct ScriptedBackgroundPlanner(Arc<Mutex<PlannerState>>);

#[derive(Default)]
pub(crate) struct PlannerState {
    pub(crate) now: Rational,
    /// Durations of the searches in their order; the last one is repeated.
    pub(crate) seconds: Vec<Rational>,
    /// Time at which the plan is ready, until it is reported.
    due: Option<Rational>,
    /// Durations of the preparations, likewise.
    preparation_times: Vec<Rational>,
    ready: Option<Rational>,
    pub(crate) preparations: usize,
    pub(crate) started_searches: usize,
    pub(crate) abandoned_searches: usize,
    pub(crate) awaited_searches: usize,
    /// `true` if there is never a plan.
    pub(crate) has_none: bool,
    /// Situations for which plans were requested.
    pub(crate) requested: Vec<Situation>,
    /// Situations for which plans were begun in advance.
    pub(crate) anticipated: Vec<Situation>,
    /// Time at which the last one of these is ready.
    anticipated_due: Rational,
    /// Task of the current search, with its goals at the beginning.
    task: Option<Task>,
}

impl ScriptedBackgroundPlanner {
    pub(crate) fn with_planning_times(seconds: &[Rational]) -> Self {
        let desk = PlannerState {
            seconds: seconds.to_vec(),
            ..PlannerState::default()
        };
        Self(Arc::new(Mutex::new(desk)))
    }

    /// Sets the durations of the preparations; without any, plans are prepared at once.
    pub(crate) fn with_preparation_times(self, seconds: &[Rational]) -> Self {
        self.state().preparation_times = seconds.to_vec();
        self
    }

    pub(crate) fn state(&self) -> MutexGuard<'_, PlannerState> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl PlannerState {
    /// Returns the time at which a plan begun now is ready.
    fn next_due(&self) -> Rational {
        let index = self.started_searches.min(self.seconds.len() - 1);
        &self.now + &self.seconds[index]
    }
}

impl Planner for ScriptedBackgroundPlanner {
    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.state().awaited_searches += 1;
        self.collect(task, situation)
    }

    fn expect(&mut self, _task: &Task, situation: &Situation) {
        let mut desk = self.state();
        desk.anticipated_due = desk.next_due();
        desk.anticipated.push(situation.clone());
    }

    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        let mut desk = self.state();
        let is_begun = desk.anticipated.last() == Some(situation);
        let due = if is_begun {
            desk.anticipated_due.clone().max(desk.now.clone())
        } else {
            desk.next_due()
        };
        desk.due = Some(due);
        desk.started_searches += 1;
        desk.requested.push(situation.clone());
        desk.task = Some(task.clone());
        true
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let begun = self.state().task.take();
        if self.state().has_none {
            return PlannerAnswer::from(PlanAnswer::Unsolvable);
        }
        Embedded::default().plan(begun.as_ref().unwrap_or(task), situation)
    }

    fn give_up(&mut self) {
        let mut desk = self.state();
        desk.due = None;
        desk.task = None;
        desk.abandoned_searches += 1;
    }
}

/// Preparer in the background that takes a given time; without one, it prepares at once.
pub(crate) struct ScriptedBackgroundPreparer(
    pub(crate) ScriptedBackgroundPlanner,
    pub(crate) pipeline::Settings,
);

impl Preparer for ScriptedBackgroundPreparer {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError> {
        PlanPreparer::new(self.1.clone()).prepare(task, plan, need)
    }

    fn begin(&mut self, _wanted: &PreparationRequest<'_>) -> bool {
        let mut desk = self.0.state();
        desk.preparations += 1;
        let Some(most) = desk.preparation_times.len().checked_sub(1) else {
            return false;
        };
        let ready = &desk.now + &desk.preparation_times[most.min(desk.preparations - 1)];
        desk.ready = Some(ready);
        true
    }

    fn give_up(&mut self) {
        self.0.state().ready = None;
    }
}

/// World with deviating durations that reports when a plan is ready.
pub(crate) struct AnnouncingWorld {
    pub(crate) inner: ScriptedWorld,
    planner: ScriptedBackgroundPlanner,
    /// Deviation of the nth start's duration, in quarters of itself.
    quarters: Vec<i64>,
    started: usize,
}

impl World for AnnouncingWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        let mut command = command.clone();
        if let Command::Start {
            duration: Some(duration),
            ..
        } = &mut command
        {
            let quarters = self.quarters.get(self.started % self.quarters.len().max(1));
            let part = Rational::new(4 + quarters.copied().unwrap_or(0), 4);
            *duration = &*duration * &part;
            self.started += 1;
        }
        self.inner.command(now, &command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut desk = self.planner.state();
        if desk.ready.as_ref().is_some_and(|ready| *ready <= desk.now) {
            // No other event is reported at that time.
            desk.ready = None;
            return Ok(TimeAdvance {
                now: desk.now.clone(),
                observations: vec![Observation {
                    time: desk.now.clone(),
                    event: Event::PlanReady,
                }],
            });
        }
        let (due, ready) = (desk.due.clone(), desk.ready.clone());
        drop(desk);
        let soonest = due.iter().chain(&ready).chain([until]).min();
        let soonest = soonest.cloned().unwrap_or_default();
        let mut passage = self.inner.wait(&soonest)?;
        let mut desk = self.planner.state();
        desk.now.clone_from(&passage.now);
        if due.is_some_and(|due| due <= passage.now) {
            desk.due = None;
            passage.observations.push(Observation {
                time: passage.now.clone(),
                event: Event::PlanMade,
            });
        }
        if ready.is_some_and(|ready| ready <= passage.now) {
            desk.ready = None;
            passage.observations.push(Observation {
                time: passage.now.clone(),
                event: Event::PlanReady,
            });
        }
        Ok(passage)
    }
}

/// Recorder of notes and of the lines of the trace.
struct Tape {
    notes: Notes,
    task: Arc<Task>,
    lines: Arc<Mutex<Vec<String>>>,
}

impl Recorder for Tape {
    fn record(&mut self, entry: &Entry<'_>) {
        self.notes.record(entry);
        let line = Line::of(&self.task, entry).text();
        if let Entry::Planned { now, .. } = entry {
            let note = format!("{}: the plan is there", now.to_decimal(1));
            let notes = self.notes.0.lock();
            notes.unwrap_or_else(PoisonError::into_inner).push(note);
        }
        let lines = self.lines.lock();
        lines.unwrap_or_else(PoisonError::into_inner).push(line);
    }
}

pub(crate) struct RunResult {
    pub(crate) notes: Vec<String>,
    pub(crate) lines: Vec<String>,
    pub(crate) report: Report,
}

pub(crate) fn settings() -> RunSettings {
    RunSettings {
        plans_in_background: true,
        monitors_slack: true,
        ..RunSettings::default()
    }
}

/// Returns the world of a script, and the flag that ends the run.
pub(crate) fn announcing_world(
    (end, script): (i64, Vec<(Rational, Event)>),
    planner: &ScriptedBackgroundPlanner,
    quarters: &[i64],
) -> (AnnouncingWorld, Arc<AtomicBool>) {
    let must_end = Arc::new(AtomicBool::new(false));
    let script = script.into_iter();
    let script = script.map(|(time, event)| Observation { time, event });
    let world = AnnouncingWorld {
        inner: ScriptedWorld {
            now: Rational::ZERO,
            coming: script.collect(),
            end: Rational::from(end),
            stop_requested: Arc::clone(&must_end),
            slow: None,
            on_cancel: None,
        },
        planner: planner.clone(),
        quarters: quarters.to_vec(),
        started: 0,
    };
    (world, must_end)
}

pub(crate) fn run_recorded(
    execution: Execution<'_>,
    task: &Arc<Task>,
    script: (i64, Vec<(Rational, Event)>),
    planner: &ScriptedBackgroundPlanner,
    quarters: &[i64],
) -> RunResult {
    let (mut world, must_end) = announcing_world(script, planner, quarters);
    run_recorded_in(execution, task, planner, &mut world, &must_end)
}

/// Runs in that world until it sets the flag.
pub(crate) fn run_recorded_in(
    execution: Execution<'_>,
    task: &Arc<Task>,
    planner: &ScriptedBackgroundPlanner,
    world: &mut dyn World,
    must_end: &Arc<AtomicBool>,
) -> RunResult {
    let must_end = Arc::clone(must_end);
    let (notes, lines) = (Notes::default(), Arc::default());
    let report = execution
        .with_planner(planner.clone())
        .recorded_by(Tape {
            notes: notes.clone(),
            task: Arc::clone(task),
            lines: Arc::clone(&lines),
        })
        .with_stop_check(move || must_end.load(Ordering::SeqCst))
        .run_in(world);
    let notes = notes.0.lock().unwrap_or_else(PoisonError::into_inner);
    let lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
    RunResult {
        notes: notes.clone(),
        lines: lines.clone(),
        report,
    }
}

pub(crate) fn seconds(seconds: i64) -> Rational {
    Rational::from(seconds)
}

#[track_caller]
pub(crate) fn assert_has(told: &RunResult, notes: &[&str]) {
    let mut left = told.notes.iter();
    for note in notes {
        let found = left.any(|it| it.contains(note));
        assert!(found, "no `{note}` in its place in {:#?}", told.notes);
    }
}
