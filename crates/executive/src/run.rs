//! Assembly of a run from its specification: world, planner, preparer and recorders.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::answers::run::{RunOutcome, run as execute};
use elbowroom::answers::{Event, Observer, StopRequest};
use elbowroom::execute::{RunInputs, RunSpec, SpecError};
use elbowroom::execution::{BeliefState, Planner, Recorder, World};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::report::trace::TraceWriter;
use elbowroom::text::Diagnostics;

use crate::background_planner::BackgroundSettings;
use crate::belief_updates::BeliefUpdates;
use crate::clock::Clock;
use crate::decorators::Decorators;
pub use crate::decorators::EntryObserver;
use crate::embedded_world::EmbeddedWorld;
use crate::error::{Error, WarningSink};
use crate::journal::{JournalFile, Segments};
use crate::journaling::{JournalHealth, JournalWriter, JournaledWorld};
use crate::operator::OperatorInterface;
use crate::process_world::ProcessLimits;
use crate::realtime::{Realtime, ScaledClock, TimedPlanner};
use crate::restartable_world::RestartableWorld;
use crate::trace_buffer::TraceBuffer;
use crate::world_connection::{Launch, WorldSource};

/// Application that embeds a run. The defaults have neither operators nor viewers.
pub trait RunHost {
    /// Returns the operators' interface to a resumed run.
    ///
    /// # Errors
    /// When the host does not support such a run.
    fn operator(&self, inputs: &RunInputs) -> Result<OperatorInterface, Error> {
        let _ = inputs;
        Ok(OperatorInterface::default())
    }

    /// Returns the rotation settings for the journal of a resumed run.
    fn segments(&self) -> Option<Segments> {
        None
    }

    /// Opens viewers of the run. Returns the buffer that receives its trace, if there are any. Called before the world
    /// starts.
    ///
    /// # Errors
    /// When a viewer cannot be opened. Nothing is executed then.
    fn open_viewers(
        &self,
        spec: &RunSpec,
        task: &Arc<Task>,
        operator: &OperatorInterface,
    ) -> Result<Option<TraceBuffer>, Error> {
        let _ = (spec, task, operator);
        Ok(None)
    }

    /// Called when execution begins. The first record is on the disk if there is a journal.
    fn started(&self) {}
}

/// Run without an outcome.
#[derive(Debug)]
pub enum RunError {
    /// The domain or the problem is invalid.
    Problem(Diagnostics),
    /// The specification is contradictory.
    Spec(SpecError),
    /// The run cannot be started or recorded.
    Failed(Error),
}

impl fmt::Display for RunError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Problem(mistakes) => match mistakes.errors().next() {
                Some(first) => first.fmt(f),
                None => f.write_str("the problem is invalid"),
            },
            Self::Spec(error) => error.fmt(f),
            Self::Failed(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for RunError {}

impl From<SpecError> for RunError {
    fn from(error: SpecError) -> Self {
        match error {
            SpecError::Problem(mistakes) => Self::Problem(mistakes),
            error => Self::Spec(error),
        }
    }
}

impl From<Error> for RunError {
    fn from(error: Error) -> Self {
        Self::Failed(error)
    }
}

/// Outcome of a run with a journal.
#[derive(Clone, Debug)]
pub struct JournaledOutcome {
    /// The outcome.
    pub outcome: RunOutcome,
    /// Reason why the journal is incomplete, or `None` if all records are written.
    pub journal_failure: Option<String>,
}

/// A run with its surroundings.
pub struct RunAssembly<'a> {
    /// The specification, with its texts read.
    pub inputs: &'a RunInputs,
    /// The first plan; without it, the planner makes one.
    pub first_plan: Option<TimeTriggeredPlan>,
    /// The world, if it is an object in this process.
    pub embedded: Option<&'a mut dyn EmbeddedWorld>,
    /// Channels to operators.
    pub operator: &'a OperatorInterface,
    /// Background planning, with the stop request of the run.
    pub background: BackgroundSettings,
    /// Limits of a world that is a process.
    pub limits: ProcessLimits,
    /// Runs from time 0 if that is a date; otherwise time 0 is the start of the run.
    pub since: Option<Clock>,
    /// Called for each entry after it is recorded, for example by a progress display.
    pub observer: Option<EntryObserver<'a>>,
    /// Receiver of warnings.
    pub warnings: WarningSink,
}

impl<'a> RunAssembly<'a> {
    /// Executes a run without a journal. `trace` receives the lines of the trace, with their line feeds. `watcher` can
    /// end the run early.
    ///
    /// # Errors
    /// When the specification is contradictory, or the run cannot be started.
    pub fn execute(
        mut self,
        trace: &mut (dyn FnMut(&str) + Send),
        host: &dyn RunHost,
        watcher: &mut (dyn Observer + Send),
    ) -> Result<RunOutcome, RunError> {
        let (spec, task) = (self.inputs.spec(), self.inputs.task());
        let buffer = host.open_viewers(spec, task, self.operator)?;
        let mut writer = TraceWriter::new(Arc::clone(task), trace);
        let written = writer.header(spec);
        written.map_err(|error| Error::new(format!("cannot write the trace: {error}"), ""))?;
        let observer = self.observer.take();
        let background = self.background.clone();
        let decorators = self.decorators(&background);
        let mut writer = decorators.recorder(&mut writer, false, buffer, observer);
        if spec.world_process.is_none() {
            return Ok(self.simulated(decorators, &mut writer, host, watcher)?);
        }
        let beliefs = BeliefUpdates::default();
        let world = RestartableWorld::start(self.launch()?, beliefs.clone())?;
        let mut world = decorators.world(world, &Rational::ONE);
        host.started();
        let outcome = self.run(
            decorators,
            &mut world,
            &mut writer,
            beliefs.listener(),
            watcher,
        );
        world.into_inner().stop();
        Ok(outcome?)
    }

    /// Executes a run in a world that is a process or in this process, with an empty journal.
    ///
    /// # Errors
    /// As [`RunAssembly::execute`], and when the first record cannot be written.
    pub fn execute_journaled(
        mut self,
        mut file: JournalFile,
        host: &dyn RunHost,
        watcher: &mut (dyn Observer + Send),
    ) -> Result<JournaledOutcome, RunError> {
        let (spec, task) = (self.inputs.spec(), self.inputs.task());
        let mut is_written = false;
        let mut sink = |line: &str| is_written = file.write(line);
        let mut header = TraceWriter::new(Arc::clone(task), &mut sink);
        let written = header.header(spec);
        written.map_err(|error| Error::new(format!("cannot write the journal: {error}"), ""))?;
        // A client that submits the problem is notified that it is on the disk. Other runs can be started again.
        if !is_written || (spec.is_persistent && !file.sync()) {
            let why = file.failure().unwrap_or_default();
            return Err(RunError::Failed(Error::new(
                format!("cannot write the journal {}: {why}", file.path().display()),
                "nothing was started; free some disk space, or choose another file",
            )));
        }
        let health = JournalHealth::default();
        let buffer = host.open_viewers(spec, task, self.operator)?;
        let beliefs = BeliefUpdates::default();
        let world = RestartableWorld::start(self.launch()?, beliefs.clone())?;
        let world = JournaledWorld::new(world, health.clone());
        let (observer, background) = (self.observer.take(), self.background.clone());
        let decorators = self.decorators(&background);
        let mut world = decorators.world(world, &Rational::ONE);
        host.started();
        let outcome = {
            let writer = JournalWriter::new(task, &mut file, &health, self.operator);
            let mut writer = decorators.recorder(writer, true, buffer, observer);
            let mut watcher = JournalWatcher {
                inner: watcher,
                health,
            };
            let listener = beliefs.listener();
            self.run(decorators, &mut world, &mut writer, listener, &mut watcher)
        };
        world.into_inner().into_inner().stop();
        Ok(JournaledOutcome {
            outcome: outcome?,
            journal_failure: file.failure(),
        })
    }

    /// Returns the decorators of the run's ports.
    fn decorators<'d>(&self, background: &'d BackgroundSettings) -> Decorators<'d>
    where
        'a: 'd,
    {
        Decorators::new(self.inputs, self.operator, background)
    }

    /// Returns the arguments for the connection to the world.
    fn launch(&mut self) -> Result<Launch<'a>, Error> {
        Ok(Launch {
            source: WorldSource::of(self.inputs.spec(), self.embedded.take())?,
            task: self.inputs.task(),
            limits: self.limits.clone(),
            stop: self.background.stop.clone(),
            warnings: self.warnings.clone(),
            queue: self.operator.queue().cloned(),
        })
    }

    fn run(
        self,
        decorators: Decorators<'_>,
        world: &mut dyn World,
        recorder: &mut dyn Recorder,
        listener: impl FnMut(&BeliefState) + Send,
        watcher: &mut (dyn Observer + Send),
    ) -> Result<RunOutcome, SpecError> {
        let clock = Clock::stopwatch();
        let continues = || !self.background.stop.is_requested();
        let planner = decorators.planner(&clock, &continues)?;
        let execution = decorators.execution(self.first_plan, planner, listener)?;
        let execution = execution.recorded_by(recorder);
        execute(self.inputs, execution, world, watcher)
    }

    /// Executes a run in the simulated world of the specification, on a wall clock if it has one.
    fn simulated(
        self,
        decorators: Decorators<'_>,
        recorder: &mut dyn Recorder,
        host: &dyn RunHost,
        watcher: &mut (dyn Observer + Send),
    ) -> Result<RunOutcome, SpecError> {
        let spec = self.inputs.spec();
        let mut world = self.inputs.world(self.first_plan.as_ref())?;
        host.started();
        let Some(factor) = &spec.realtime else {
            return self.run(
                decorators,
                world.as_mut(),
                recorder,
                |_: &BeliefState| {},
                watcher,
            );
        };
        let world_clock = ScaledClock::new(factor, self.since);
        let clock = Clock::stopwatch();
        let continues = || !self.background.stop.is_requested();
        let world = Realtime {
            inner: world.as_mut(),
            clock: &world_clock,
            stop: &self.background.stop,
        };
        let mut world = decorators.world(world, factor);
        let planner = TimedPlanner {
            inner: Box::new(decorators.planner(&clock, &continues)?) as Box<dyn Planner>,
            clock: &world_clock,
            planning_time: &spec.planning_time,
        };
        let execution = decorators.execution(self.first_plan, planner, |_: &BeliefState| {})?;
        let execution = execution.recorded_by(recorder);
        execute(self.inputs, execution, &mut world, watcher)
    }
}

/// Watcher that also ends a run after a failure of its journal.
struct JournalWatcher<'w> {
    inner: &'w mut (dyn Observer + Send),
    health: JournalHealth,
}

impl Observer for JournalWatcher<'_> {
    fn elapsed(&mut self) -> Duration {
        self.inner.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.health.has_failed() {
            return ControlFlow::Break(StopRequest::Cancelled);
        }
        self.inner.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        self.inner.notice(event);
    }
}
