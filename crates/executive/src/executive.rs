//! Persistent executive in this process.

use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use elbowroom::answers::{Observer, StopRequest};
use elbowroom::execute::{RunInputs, RunSpec};
use elbowroom::execution::run::PlanningTime;
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;
use elbowroom::report::trace::TraceWriter;

use crate::background_planner::BackgroundSettings;
use crate::clock::Clock;
use crate::completion_signal::CompletionSignal;
use crate::embedded_world::EmbeddedWorld;
use crate::error::{Error, WarningSink};
use crate::goal_request::GoalNames;
use crate::interface::Status;
use crate::interface::documents::{NewGoal, State, WhatIf};
use crate::journal::{JournalFile, Segments};
use crate::learning::{Learner, Learning};
use crate::messages::io_error_message;
use crate::operator::OperatorInterface;
use crate::process_world::ProcessLimits;
use crate::request_check::{check, check_target};
use crate::request_queue::{ExternalRequest, RequestQueue, RequestStatus};
use crate::resume::{InterruptedRun, JournaledRun, ResumeSettings};
use crate::run::{JournaledOutcome, RunAssembly, RunError, RunHost};
use crate::trace_buffer::TraceBuffer;
use crate::what_if::what_if;

/// Settings of an executive that its specification does not contain.
#[derive(Clone, Debug)]
pub struct ExecutiveSettings {
    /// File of the journal. Only runs in a world that is a process, or in this process, can have one.
    pub journal: Option<PathBuf>,
    /// Folder of logs and of the model learnt from them ([`Learner`]). Only runs with a journal can have one.
    pub learn: Option<PathBuf>,
    /// Rotation of the journal.
    pub segments: Option<Segments>,
    /// Limits of a world that is a process.
    pub limits: ProcessLimits,
    /// Limit on the memory of planning, in bytes above the memory of the process at its start.
    pub planner_memory: Option<u64>,
    /// Receiver of warnings.
    pub warnings: WarningSink,
}

impl Default for ExecutiveSettings {
    /// No journal; one hour for each answer of the world, whose invalid messages are ignored; 1 GB for planning.
    fn default() -> Self {
        Self {
            journal: None,
            learn: None,
            segments: None,
            limits: ProcessLimits {
                answer_timeout: Rational::from(3600),
                is_strict: false,
                restarts: 0,
            },
            planner_memory: Some(1000 << 20),
            warnings: WarningSink::default(),
        }
    }
}

/// Persistent run that accepts goals, facts and pauses until it is stopped.
///
/// One thread calls [`Executive::run`] or [`Executive::run_in`]. All other methods can be called from any thread during
/// the run.
pub struct Executive {
    inputs: RunInputs,
    /// The problem with its own table of facts, for checks of requests.
    checks: Task,
    settings: ExecutiveSettings,
    queue: RequestQueue,
    names: GoalNames,
    status: Status,
    buffer: TraceBuffer,
    stop: Stop,
    /// Start of the run, until it is started.
    start: Mutex<Option<Start>>,
}

/// Start of a run.
enum Start {
    /// A new run, with its empty journal.
    New(Option<JournalFile>),
    /// A run that is resumed.
    Resumed(Box<InterruptedRun>),
}

impl Executive {
    /// Creates an executive for the domain, the problem, the world and the planner of a specification. Planning takes
    /// its measured time. A simulated world runs on the wall clock. If `spec.is_world_embedded`, the world is given to
    /// [`Executive::run_in`].
    ///
    /// # Errors
    /// When the domain or the problem is invalid, the specification is contradictory, or the journal cannot be created.
    pub fn new(mut spec: RunSpec, settings: ExecutiveSettings) -> Result<Self, RunError> {
        if spec.is_world_embedded && spec.world_process.is_none() {
            spec.world_process = Some("embedded".to_owned());
        }
        if spec.world_process.is_none() && spec.realtime.is_none() {
            spec.realtime = Some(Rational::ONE);
        }
        spec.planning_time = PlanningTime::Measured;
        make_persistent(&mut spec);
        spec.check_new()?;
        if settings.learn.is_some() && settings.journal.is_none() {
            let error = "a model is learnt from the journal, but the run has no journal";
            let advice = "name a journal, or leave out the folder of the model";
            return Err(RunError::Failed(Error::new(error, advice)));
        }
        let journal = match &settings.journal {
            Some(_) if spec.world_process.is_none() => {
                return Err(RunError::Failed(Error::new(
                    "a run in a simulated world cannot have a journal: the world ends with the program",
                    "name a world process, pass a world object, or leave out the journal",
                )));
            }
            Some(path) => {
                let file = JournalFile::create(path, "Executive::resume")?;
                Some(file.with_rotation(settings.segments, &settings.warnings))
            }
            None => None,
        };
        let names = GoalNames::default();
        Self::with_start(spec, settings, Start::New(journal), names)
    }

    /// Creates an executive that resumes the run of a journal, which replaces `settings.journal`.
    ///
    /// # Errors
    /// When the journal cannot be read, is damaged, is written by another program, or is that of a finished run.
    pub fn resume(journal: &Path, mut settings: ExecutiveSettings) -> Result<Self, RunError> {
        settings.journal = Some(journal.to_owned());
        let cannot = |error: &std::io::Error| {
            let message = format!(
                "cannot read {}: {}",
                journal.display(),
                io_error_message(error)
            );
            Error::new(message, "check the path of the journal")
        };
        let text = fs::read_to_string(journal).map_err(|error| cannot(&error))?;
        match InterruptedRun::read(journal, &text, text.len() as u64)? {
            JournaledRun::Interrupted(run) => {
                let names = GoalNames::after(run.goal_names().iter().map(String::as_str));
                let (spec, run) = (run.spec().clone(), Box::new(run.open_exclusively()?));
                Self::with_start(spec, settings, Start::Resumed(run), names)
            }
            JournaledRun::Achieved(_) => {
                let message = format!("the run of {} has reached its goal", journal.display());
                Err(Error::new(message, "there is nothing to resume").into())
            }
        }
    }

    fn with_start(
        spec: RunSpec,
        settings: ExecutiveSettings,
        start: Start,
        names: GoalNames,
    ) -> Result<Self, RunError> {
        let (inputs, _) = RunInputs::read(spec)?;
        let (spec, task) = (inputs.spec(), inputs.task());
        let buffer = TraceBuffer::bounded();
        let mut header = |line: &str| buffer.add(line);
        let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
        written.map_err(|error| Error::new(format!("cannot write the trace: {error}"), ""))?;
        let status = Status::new(task, spec.timeout.clone());
        // Until its journal is replayed.
        status.set_replayed(matches!(start, Start::Resumed(_)));
        Ok(Self {
            status,
            checks: task.with_own_table(),
            inputs,
            settings,
            queue: RequestQueue::default(),
            names,
            buffer,
            stop: Stop::default(),
            start: Mutex::new(Some(start)),
        })
    }

    /// Submits a request, and waits until the run accepts it, for at most `timeout`.
    ///
    /// # Errors
    /// When a goal, its name or its value is invalid, a fact, fluent, open goal or running action is unknown, or the
    /// queue is full.
    pub fn submit(
        &self,
        request: ExternalRequest,
        timeout: Duration,
    ) -> Result<RequestStatus, Error> {
        check(&request, &self.checks)?;
        check_target(&request, &self.status, &self.queue)?;
        let number = self.queue.submit(vec![request]).ok_or_else(|| {
            Error::new("too many requests are pending", "repeat the request later")
        })?;
        Ok(self.queue.wait_until_accepted(number, timeout))
    }

    /// Submits a goal as [`Executive::submit`] does. Returns its name, which is made up if none is given.
    ///
    /// # Errors
    /// As [`Executive::submit`], and when the goal has two deadlines, or one that has passed.
    pub fn submit_goal(
        &self,
        goal: NewGoal,
        timeout: Duration,
    ) -> Result<(String, RequestStatus), Error> {
        let (name, request) = self.names.request(goal, &self.status)?;
        let status = self.submit(request, timeout)?;
        Ok((name, status))
    }

    /// Returns the outcome of a goal if it were given now and everything went as planned. The run does not change.
    ///
    /// # Errors
    /// When the goal is invalid, or the run has not begun.
    pub fn what_if(&self, goal: NewGoal) -> Result<WhatIf, Error> {
        what_if(&self.inputs, &self.status, goal)
    }

    /// Returns `true` if the run has accepted all submitted requests.
    pub fn is_idle(&self) -> bool {
        self.queue.is_idle()
    }

    /// Returns the specification of the run.
    pub fn spec(&self) -> &RunSpec {
        self.inputs.spec()
    }

    /// Returns the problem of the run.
    pub fn task(&self) -> &Arc<Task> {
        self.inputs.task()
    }

    /// Returns the published status of the run: goals, plan, guarantee and the next decision.
    pub fn published(&self) -> &Status {
        &self.status
    }

    /// Returns the state of the run: activity, goals, running actions, believed facts and numbers.
    pub fn status(&self) -> State {
        State {
            unanswered: self.queue.silence(),
            ..self.status.state()
        }
    }

    /// Returns the trace of the run. Its streams send each new line.
    pub fn events(&self) -> &TraceBuffer {
        &self.buffer
    }

    /// Requests an orderly shutdown: running actions are cancelled, and the world is stopped.
    pub fn stop(&self) {
        self.stop.request();
    }

    /// Executes the run in this thread until it is stopped or fails. Computations of this thread obey the stop request, except while a journal is replayed.
    ///
    /// # Errors
    /// When the run cannot be started, was started before, or its world is an object in this process.
    pub fn run(&self) -> Result<JournaledOutcome, RunError> {
        self.run_with(None)
    }

    /// Executes the run as [`Executive::run`] does, in a world that is an object in this process.
    ///
    /// # Errors
    /// When the run cannot be started, was started before, or its world is not an object in this
    /// process.
    pub fn run_in(&self, world: &mut dyn EmbeddedWorld) -> Result<JournaledOutcome, RunError> {
        self.run_with(Some(world))
    }

    fn run_with(
        &self,
        world: Option<&mut dyn EmbeddedWorld>,
    ) -> Result<JournaledOutcome, RunError> {
        let start = self.start.lock();
        let start = start.unwrap_or_else(PoisonError::into_inner).take();
        let start = start.ok_or_else(|| {
            Error::new(
                "the run has already been started",
                "create another executive",
            )
        })?;
        self.stop.install_for_thread();
        let outcome = self.execute(start, world);
        self.queue.close();
        self.buffer.close();
        outcome
    }

    fn execute(
        &self,
        start: Start,
        embedded: Option<&mut dyn EmbeddedWorld>,
    ) -> Result<JournaledOutcome, RunError> {
        let embedded = embedded.map(with_shorter_lifetime);
        let mut watcher = StopWatcher {
            clock: Clock::start(),
            stop: self.stop.clone(),
        };
        let background = BackgroundSettings {
            stop: self.stop.clone(),
            signal: CompletionSignal::default(),
            memory_limit: self.settings.planner_memory,
        };
        let limits = self.settings.limits.clone();
        let operator = self.operator_interface();
        let warnings = self.settings.warnings.clone();
        let learning = self.learning()?;
        let observer = learning.as_ref().map(|it| Box::new(it.observer()) as _);
        let journal = match start {
            Start::Resumed(run) => {
                let settings = ResumeSettings {
                    inputs: &self.inputs,
                    embedded,
                    background,
                    limits,
                    observer,
                    warnings,
                };
                let outcome = run.resume(settings, self, &mut watcher);
                return finish_learning(learning, outcome);
            }
            Start::New(journal) => journal,
        };
        let run = RunAssembly {
            inputs: &self.inputs,
            first_plan: None,
            embedded,
            operator: &operator,
            background,
            limits,
            since: None,
            observer,
            warnings,
        };
        match journal {
            Some(file) => {
                let outcome = run.execute_journaled(file, self, &mut watcher);
                finish_learning(learning, outcome)
            }
            None => Ok(JournaledOutcome {
                outcome: run.execute(&mut |_| {}, self, &mut watcher)?,
                journal_failure: None,
            }),
        }
    }

    /// Starts learning from the journal if the settings ask for it.
    fn learning(&self) -> Result<Option<Learning>, Error> {
        let learn = self.settings.learn.as_ref();
        let Some((folder, journal)) = learn.zip(self.settings.journal.as_ref()) else {
            return Ok(None);
        };
        let learner = Learner::new(folder, journal, self.settings.warnings.clone())?;
        Ok(Some(Learning::start(learner)))
    }

    fn operator_interface(&self) -> OperatorInterface {
        OperatorInterface::new(self.queue.clone(), self.status.clone(), self.buffer.clone())
    }
}

/// Learns from the whole run after its end.
fn finish_learning<T>(learning: Option<Learning>, outcome: T) -> T {
    if let Some(learning) = learning {
        learning.finish();
    }
    outcome
}

impl RunHost for Executive {
    fn operator(&self, inputs: &RunInputs) -> Result<OperatorInterface, Error> {
        if !inputs.spec().is_persistent {
            return Err(Error::new(
                "this is the journal of a run that ends with its goal",
                "resume it with `elbowroom run --resume`",
            ));
        }
        Ok(self.operator_interface())
    }

    fn segments(&self) -> Option<Segments> {
        self.settings.segments
    }
}

/// Makes the run of a specification persistent: it waits for further goals, and plans in the background.
pub fn make_persistent(spec: &mut RunSpec) {
    spec.is_persistent = true;
    spec.plans_in_background = spec.can_plan_in_background();
    spec.prepares_in_background = spec.plans_in_background;
}

/// Returns the world with a shorter lifetime.
fn with_shorter_lifetime<'a>(
    world: &'a mut (dyn EmbeddedWorld + '_),
) -> &'a mut (dyn EmbeddedWorld + 'a) {
    world
}

/// Watcher that ends a run on a stop request.
struct StopWatcher {
    clock: Clock,
    stop: Stop,
}

impl Observer for StopWatcher {
    fn elapsed(&mut self) -> Duration {
        self.clock.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.stop.is_requested() {
            ControlFlow::Break(StopRequest::Cancelled)
        } else {
            ControlFlow::Continue(())
        }
    }
}
