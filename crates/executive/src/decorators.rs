//! Decorators of the ports of a run, and their order: [`Decorators`].
//!
//! Each row lists the decorators from the outside, which the run calls, to the inside. A decorator in brackets is used
//! only by some runs.
//!
//! | port | order | reason for the order |
//! |---|---|---|
//! | recorder | validator, [`ViewedRecorder`], [`TeeRecorder`], [`ReplayRecorder`], [`JournalWriter`] or trace | viewers and operators receive an entry after it is in the journal; a replayed entry is not written again |
//! | planner | [`ResumedPlanner`], [`TimedPlanner`], [`BackgroundPlanner`], planner of the inputs | the journal's plans come first; the planning time includes the wait for the background |
//! | preparer | [`BackgroundPreparer`], preparer of the inputs | |
//! | world | [`InteractiveWorld`], [`JournaledWorld`], [`ResumedWorld`], then [`RestartableWorld`] or [`Realtime`] and the simulation | requests of operators are observations; a command reaches the world after its entry is on the disk, also during a replay |
//!
//! [`ReplayRecorder`]: crate::resume
//! [`ResumedWorld`]: crate::resume
//! [`ResumedPlanner`]: crate::resume
//! [`JournalWriter`]: crate::journaling::JournalWriter
//! [`JournaledWorld`]: crate::journaling::JournaledWorld
//! [`TimedPlanner`]: crate::realtime::TimedPlanner
//! [`Realtime`]: crate::realtime::Realtime
//! [`RestartableWorld`]: crate::restartable_world::RestartableWorld

use std::sync::Arc;

use elbowroom::execute::{Execution, RunInputs, SpecError};
use elbowroom::execution::run::RunSnapshot;
use elbowroom::execution::{BeliefState, Entry, Planner, Recorder, World};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::report::trace::Line;

use crate::background_planner::{BackgroundPlanner, BackgroundSettings};
use crate::background_preparer::BackgroundPreparer;
use crate::operator::{InteractiveWorld, OperatorInterface, TeeRecorder};
use crate::trace_buffer::TraceBuffer;

/// Callback for entries of the record.
pub type EntryObserver<'a> = Box<dyn FnMut(&Entry<'_>) + Send + 'a>;

/// Wraps the ports of a run in the decorators that all runs have.
#[derive(Clone, Copy)]
pub(crate) struct Decorators<'a> {
    inputs: &'a RunInputs,
    operator: &'a OperatorInterface,
    background: &'a BackgroundSettings,
}

impl<'a> Decorators<'a> {
    pub(crate) fn new(
        inputs: &'a RunInputs,
        operator: &'a OperatorInterface,
        background: &'a BackgroundSettings,
    ) -> Self {
        Self {
            inputs,
            operator,
            background,
        }
    }

    /// Returns the execution of the inputs, which begins with the plan `first`, with this planner, decorated by [`Self::planner`] or a decorator of that.
    pub(crate) fn execution<'e>(
        &self,
        first: Option<TimeTriggeredPlan>,
        planner: impl Planner + 'e,
        listener: impl FnMut(&BeliefState) + Send + 'e,
    ) -> Result<Execution<'e>, SpecError> {
        let preparer = BackgroundPreparer::new(self.inputs, &self.background.signal);
        Ok(self
            .inputs
            .execution(first)?
            .with_planner(planner)
            .with_preparer(preparer)
            .on_belief(both(self.operator.listener(), listener)))
    }

    /// Returns the planner of the inputs, with background planning. `clock` measures its planning time.
    pub(crate) fn planner<'p>(
        &self,
        clock: &'p (dyn Fn() -> Rational + Sync),
        continues: &'p (dyn Fn() -> bool + Sync),
    ) -> Result<BackgroundPlanner<'p>, SpecError> {
        let planner = self.inputs.planner(clock, continues)?;
        Ok(BackgroundPlanner::new(
            planner,
            self.inputs.spec(),
            self.background,
        ))
    }

    /// Returns the recorder, decorated for operators and viewers. `is_journal` if `inner` writes a journal.
    pub(crate) fn recorder<'o, R: Recorder>(
        &self,
        inner: R,
        is_journal: bool,
        buffer: Option<TraceBuffer>,
        observer: Option<EntryObserver<'o>>,
    ) -> ViewedRecorder<'o, TeeRecorder<R>> {
        let task = self.inputs.task();
        let published = self.operator.publishing(inner, task, is_journal);
        ViewedRecorder::new(published, task, buffer, observer)
    }

    /// Returns the world, decorated for operators' requests and background planning. `factor` is the number of the
    /// world's seconds per second of the wall clock.
    pub(crate) fn world<'w, W: World>(
        &self,
        world: W,
        factor: &Rational,
    ) -> InteractiveWorld<'w, W> {
        let BackgroundSettings { stop, signal, .. } = self.background;
        InteractiveWorld::new(
            world,
            self.operator,
            self.inputs.task(),
            stop,
            signal,
            factor,
        )
    }
}

/// Returns a callback that passes the belief state to both callbacks.
fn both(
    mut one: impl FnMut(&BeliefState) + Send,
    mut other: impl FnMut(&BeliefState) + Send,
) -> impl FnMut(&BeliefState) + Send {
    move |belief| {
        one(belief);
        other(belief);
    }
}

/// Recorder that passes entries on, then shows them to viewers.
pub(crate) struct ViewedRecorder<'a, R> {
    inner: R,
    task: Arc<Task>,
    buffer: Option<TraceBuffer>,
    observer: Option<EntryObserver<'a>>,
}

impl<'a, R: Recorder> ViewedRecorder<'a, R> {
    pub(crate) fn new(
        inner: R,
        task: &Arc<Task>,
        buffer: Option<TraceBuffer>,
        observer: Option<EntryObserver<'a>>,
    ) -> Self {
        Self {
            inner,
            task: Arc::clone(task),
            buffer,
            observer,
        }
    }
}

impl<R: Recorder> Recorder for ViewedRecorder<'_, R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(buffer) = &self.buffer {
            buffer.add(&format!("{}\n", Line::of(&self.task, entry).text()));
        }
        if let Some(observer) = &mut self.observer {
            observer(entry);
        }
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        self.inner.begin_anew(stand)
    }
}
