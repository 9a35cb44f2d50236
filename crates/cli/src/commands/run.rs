//! `elbowroom run`: execute a plan in a world.

pub(super) mod live;
mod replay;
pub(super) mod resume;
mod shown;
pub(super) mod spec;
mod text;
pub(super) mod trace_file;

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::RoundingRule;
use elbowroom::answers::run::{RunOutcome, run as execute};
use elbowroom::answers::{Event, Halt, RunRequest, Watcher};
use elbowroom::execute::{NamedText, RunSpec, SpecError, check_vary};
use elbowroom::execution::run::{MissingPlan, Verdict};
use elbowroom::execution::{Planner, Progression, Recorder, World};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::report::trace;
use elbowroom::sim::WorldModel;
use elbowroom::text::Source;

use crate::args::RunArgs;
use crate::calendar::dated;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::look::{BAD, styled};
use crate::output::{self, Output};
use crate::stopwatch::Stopwatch;
use elbowroom_executive::background_planner::{BackgroundPlanner, BackgroundSettings};
use elbowroom_executive::background_preparer::BackgroundPreparer;
use elbowroom_executive::belief_updates::BeliefUpdates;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::completion_signal::CompletionSignal;
use elbowroom_executive::journal::JournalFile;
use elbowroom_executive::journaling::{JournalHealth, JournalWriter, JournaledWorld};
use elbowroom_executive::messages::escape_control;
use elbowroom_executive::operator::{InteractiveWorld, OperatorInterface};
use elbowroom_executive::process_world::{ProcessLimits, ProcessWorld, check_program};
use elbowroom_executive::realtime::{Pace, PacedPlanner, Realtime};
use elbowroom_executive::request_queue::RequestQueue;
use shown::Views;
use spec::contradiction;
use trace_file::TraceFile;

/// Executes a plan, or plays a stored run back.
pub(crate) fn run(arguments: &RunArgs, output: &mut Output) -> Answer {
    if let Some(path) = &arguments.replay {
        return replay::run(path, arguments.json, output);
    }
    if let Some(path) = &arguments.resume {
        return resume::run(path, arguments, &resume::Alone(arguments), output);
    }
    let (Some(domain), Some(problem)) = (&arguments.domain, &arguments.problem) else {
        return Err(Failure::new(
            "PROBLEM is missing",
            "give domain and problem, in this order: elbowroom run DOMAIN PROBLEM",
        ));
    };
    let mut since = None;
    let problem = |domain: &NamedText| {
        let problem = input::source(problem, "problem")?;
        let factor = match &arguments.world_process {
            Some(_) => Some(Rational::ONE),
            None => arguments.realtime.clone(),
        };
        let (problem, at) = dated((&arguments.calendar, factor), domain, problem, output)?;
        since = at;
        Ok((&problem).into())
    };
    let (mut spec, world) = spec::of(arguments, domain, problem)?;
    spec.is_attended = arguments.control.is_some();
    let (task, first) = checked(arguments, &spec, world.as_ref(), output)?;
    let operator = operator(arguments);
    let interrupt = Interrupt::listen_with_world();
    let job = Job {
        journal: journal(arguments, RESUME)?,
        begun: &|| (),
        since,
        background: background(arguments, &interrupt),
        spec: &spec,
        task: &task,
        first,
        interrupt: &interrupt,
        operator: &operator,
    };
    job.execute(arguments, output)
}

/// What goes on with the journal of a run that ends with its goal.
pub(super) const RESUME: &str = "elbowroom run --resume";

/// What goes on with the journal of an executive.
pub(super) const RESUME_SERVE: &str = "elbowroom serve --resume";

/// The journal that is asked for, which is empty yet. That there is no such program as its world is told
/// before.
pub(super) fn journal(arguments: &RunArgs, resume: &str) -> Result<Option<JournalFile>, Failure> {
    let Some(command) = &arguments.world_process else {
        return Ok(None);
    };
    check_program(command)?;
    let path = arguments.journal.as_deref();
    path.map(|path| JournalFile::create(path, resume))
        .transpose()
        .map_err(Failure::from)
}

/// Returns the settings of background planning.
pub(super) fn background(arguments: &RunArgs, interrupt: &Interrupt) -> BackgroundSettings {
    BackgroundSettings {
        stop: interrupt.stop().clone(),
        signal: CompletionSignal::default(),
        most_memory: arguments.planner_memory.map(|megabytes| megabytes << 20),
    }
}

/// Those who may ask something of a run on its page, if anybody may.
pub(super) fn operator(arguments: &RunArgs) -> OperatorInterface {
    match &arguments.control {
        Some(_) => OperatorInterface::with_queue(RequestQueue::default()),
        None => OperatorInterface::default(),
    }
}

/// The problem of a specification, and the plan to begin with. What is wrong with a file is told
/// before anything is done.
pub(super) fn checked(
    arguments: &RunArgs,
    spec: &RunSpec,
    world: Option<&Source>,
    output: &mut Output,
) -> Result<(Arc<Task>, Option<TimeTriggeredPlan>), Failure> {
    let task = task(spec, output)?;
    let first = match arguments.plan() {
        Some(path) => Some(input::time_triggered(
            &task,
            path,
            &RoundingRule::with_tolerance(arguments.tolerance.clone()),
            input::FIXED_TIMES,
            output,
        )?),
        None => None,
    };
    spec.likelihoods(&task).map_err(contradiction)?;
    if let Some(source) = world {
        WorldModel::read(source, task.problem())
            .map_err(|wrong| contradiction(SpecError::World(wrong)))?;
    }
    check_vary(&task, &spec.vary).map_err(|error| {
        Failure::new(error, "`elbowroom help envelope` says what --vary can name")
    })?;
    spec.check().map_err(contradiction)?;
    Ok((Arc::new(task), first))
}

fn show(
    (arguments, spec): (&RunArgs, &RunSpec),
    outcome: &RunOutcome,
    has_lost: bool,
    output: &mut Output,
) -> Result<(), Failure> {
    if arguments.json {
        output.document(&outcome.answer)
    } else {
        let ends = text::Ends {
            has_lost,
            is_lasting: spec.is_lasting,
        };
        output::print(&text::human(&outcome.answer, &outcome.report, ends))?;
        let is_given = arguments.plan().is_some() && outcome.report.starts == 0;
        if let Verdict::NoPlan { why, .. } = outcome.verdict()
            && is_given
            && why.starts_with("the plan is not valid")
        {
            input::tell_about_repairs();
        }
        Ok(())
    }
}

/// Shows what came of a run with a journal; `trouble` is why that could not be written.
pub(super) fn conclude(
    asked: (&RunArgs, &RunSpec),
    mut outcome: RunOutcome,
    trouble: Option<String>,
    output: &mut Output,
) -> Answer {
    let Some(why) = trouble else {
        show(asked, &outcome, false, output)?;
        let journal = asked.0.journal.as_ref().or(asked.0.resume.as_ref());
        return exit(&outcome, journal.map(|path| path.display().to_string()));
    };
    // Nobody has asked it to end.
    let has_lost = *outcome.verdict() == Verdict::Interrupted;
    if has_lost {
        outcome.answer.report.why = Some(format!("the journal cannot be written: {why}"));
    }
    show(asked, &outcome, has_lost, output)?;
    let resume = if asked.1.is_lasting {
        RESUME_SERVE
    } else {
        RESUME
    };
    Err(Failure::new(
        format!("the journal cannot be written ({why}), so the run was ended in order"),
        format!("make room on the disk; `{resume}` goes on from what the journal has"),
    ))
}

/// The problem of a specification, with its warnings told.
pub(super) fn task(spec: &RunSpec, output: &mut Output) -> Result<Task, Failure> {
    let (domain, problem) = (spec.domain.source(), spec.problem.source());
    let read = elbowroom::pddl::read_problem(&domain, &problem);
    let problem = Arc::new(input::with_warnings(read, output)?);
    Ok(Task::new(problem).with_epsilon(spec.epsilon.clone()))
}

/// Tells both what the run believes.
fn both(
    mut one: impl FnMut(&Progression) + Send,
    mut other: impl FnMut(&Progression) + Send,
) -> impl FnMut(&Progression) + Send {
    move |belief| {
        one(belief);
        other(belief);
    }
}

/// Everything that a run needs but the world.
pub(super) struct Job<'a> {
    pub(super) spec: &'a RunSpec,
    pub(super) task: &'a Arc<Task>,
    pub(super) first: Option<TimeTriggeredPlan>,
    pub(super) interrupt: &'a Interrupt,
    pub(super) operator: &'a OperatorInterface,
    pub(super) background: BackgroundSettings,
    /// Its journal, which is empty, if it is to have one.
    pub(super) journal: Option<JournalFile>,
    /// Told when the run begins, and its first record is on the disk if there is a journal.
    pub(super) begun: &'a dyn Fn(),
    /// Runs from time 0, where that is a date and not the beginning of the run.
    pub(super) since: Option<Clock>,
}

impl Job<'_> {
    /// The run that the arguments ask for, from its beginning to its exit code.
    pub(super) fn execute(mut self, arguments: &RunArgs, output: &mut Output) -> Answer {
        if let (Some(file), Some(command)) = (self.journal.take(), &arguments.world_process) {
            return self.journaled(file, command, arguments, output);
        }
        let (spec, task, interrupt) = (self.spec, self.task, self.interrupt);
        let mut file = TraceFile::open(arguments.trace.as_deref())?;
        let views = Views::open(arguments, spec, task, interrupt, self.operator)?;
        let outcome = {
            let mut sink = |line: &str| file.write(line);
            let mut writer = trace::TraceWriter::new(Arc::clone(task), &mut sink);
            let written = writer.header(spec);
            written
                .map_err(|error| Failure::new(format!("cannot write the trace: {error}"), ""))?;
            let writer = self.operator.publishing(&mut writer, task, false);
            let mut writer = views.shown(writer, task);
            let mut writer = live::Live::new(&mut writer);
            match &arguments.world_process {
                Some(command) => {
                    let limits = ProcessLimits {
                        answer_timeout: arguments.answer_within.clone(),
                        is_strict: arguments.strict_world,
                    };
                    let stop = interrupt.stop().clone();
                    let world = ProcessWorld::start(command, task, limits, stop)?;
                    let beliefs = BeliefUpdates::default();
                    let world = world.with_beliefs(beliefs.clone());
                    let mut world = self.attended(world, &Rational::ONE);
                    (self.begun)();
                    let outcome = self.run(&mut world, &mut writer, beliefs.listener());
                    world.into_inner().stop();
                    outcome.map_err(contradiction)?
                }
                None => self.simulated(&mut writer).map_err(contradiction)?,
            }
        };
        views.close();
        let is_valid = outcome.answer.invalid.is_empty();
        let trace = (!is_valid).then(|| file.of_invalid_run()).flatten();
        let trouble = file.close();
        let shown = show((arguments, spec), &outcome, false, output);
        // The run has been what it was, whatever became of its record.
        if let Some(trouble) = trouble {
            output::warn(&trouble);
        }
        shown?;
        exit(&outcome, trace)
    }

    /// A world that takes requests, if the run is attended.
    fn attended<'w, W: World>(&self, world: W, factor: &Rational) -> InteractiveWorld<'w, W> {
        let (stop, signal) = (self.interrupt.stop(), &self.background.signal);
        InteractiveWorld::new(world, self.operator, self.task, stop, signal, factor)
    }

    fn run(
        self,
        world: &mut dyn World,
        recorder: &mut dyn Recorder,
        mut believes: impl FnMut(&Progression) + Send,
    ) -> Result<RunOutcome, SpecError> {
        let begun = Clock::start();
        let clock = || begun.seconds();
        let goes_on = || !self.interrupt.is_requested();
        let model = self.spec.model(self.task.problem());
        let model = model.map_err(SpecError::World)?;
        let planner = self
            .spec
            .planner_for(self.task, model.as_ref(), &clock, &goes_on)?;
        let request = RunRequest::new(self.spec, self.task)
            .beginning_with(self.first)
            .planned_by(BackgroundPlanner::new(planner, self.spec, &self.background))
            .prepared_by(BackgroundPreparer::new(
                self.spec,
                self.task,
                &self.background.signal,
            )?)
            .told_to(both(self.operator.listener(), &mut believes))
            .recorded_by(recorder);
        execute(request, world, &mut Stopwatch::start(self.interrupt))
    }

    /// A run in a world that is a process, with a journal.
    fn journaled(
        self,
        mut file: JournalFile,
        command: &str,
        arguments: &RunArgs,
        output: &mut Output,
    ) -> Answer {
        let mut is_kept = false;
        let mut sink = |line: &str| is_kept = file.write(line);
        let mut header = trace::TraceWriter::new(Arc::clone(self.task), &mut sink);
        let written = header.header(self.spec);
        written.map_err(|error| Failure::new(format!("cannot write the journal: {error}"), ""))?;
        // Whoever has given the problem is told that it is on the disk. A run begins again without that.
        if !is_kept || (self.spec.is_lasting && !file.sync()) {
            let why = file.failure().unwrap_or_default();
            return Err(Failure::new(
                format!("cannot write the journal {}: {why}", file.path().display()),
                "nothing was started; make room on the disk, or choose another file",
            ));
        }
        let limits = ProcessLimits {
            answer_timeout: arguments.answer_within.clone(),
            is_strict: arguments.strict_world,
        };
        let health = JournalHealth::default();
        let interrupt = self.interrupt;
        let views = Views::open(arguments, self.spec, self.task, interrupt, self.operator)?;
        let world = ProcessWorld::start(command, self.task, limits, interrupt.stop().clone())?;
        let beliefs = BeliefUpdates::default();
        let world = JournaledWorld::new(world.with_beliefs(beliefs.clone()), health.clone());
        let mut world = self.attended(world, &Rational::ONE);
        (self.begun)();
        let outcome = {
            let queue = self.operator.queue();
            let writer = JournalWriter::new(self.task, &mut file, &health, queue);
            let writer = self.operator.publishing(writer, self.task, true);
            let mut writer = views.shown(writer, self.task);
            let begun = Clock::start();
            let clock = || begun.seconds();
            let goes_on = || !interrupt.is_requested();
            let planner = self.spec.planner_for(self.task, None, &clock, &goes_on);
            let planner = planner.map_err(contradiction)?;
            let readied = BackgroundPreparer::new(self.spec, self.task, &self.background.signal);
            let readied = readied.map_err(contradiction)?;
            let request = RunRequest::new(self.spec, self.task)
                .beginning_with(self.first)
                .planned_by(BackgroundPlanner::new(planner, self.spec, &self.background))
                .prepared_by(readied)
                .told_to(both(self.operator.listener(), beliefs.listener()))
                .recorded_by(live::Live::new(&mut writer));
            let mut watch = Attentive {
                inner: Stopwatch::start(interrupt),
                health,
            };
            execute(request, &mut world, &mut watch)
        };
        world.into_inner().into_inner().stop();
        views.close();
        let outcome = outcome.map_err(contradiction)?;
        conclude((arguments, self.spec), outcome, file.failure(), output)
    }

    /// A run in the world that the specification describes, on a wall clock if it asks for one.
    fn simulated(self, recorder: &mut dyn Recorder) -> Result<RunOutcome, SpecError> {
        let (spec, task) = (self.spec, self.task);
        let model = spec.model(task.problem()).map_err(SpecError::World)?;
        let model = model.unwrap_or_default();
        let mut world = spec.world(&model, task, self.first.as_ref())?;
        (self.begun)();
        let Some(factor) = &spec.realtime else {
            return self.run(world.as_mut(), recorder, |_: &Progression| {});
        };
        let pace = Pace::new(factor, self.since);
        let begun = Clock::start();
        let clock = || begun.seconds();
        let goes_on = || !self.interrupt.is_requested();
        let planner = spec.planner_for(task, Some(&model), &clock, &goes_on)?;
        let planner: Box<dyn Planner> =
            Box::new(BackgroundPlanner::new(planner, spec, &self.background));
        let world = Realtime {
            inner: world.as_mut(),
            pace: &pace,
            stop: self.interrupt.stop(),
        };
        let mut world = self.attended(world, factor);
        let request = RunRequest::new(spec, task)
            .beginning_with(self.first)
            .told_to(self.operator.listener())
            .prepared_by(BackgroundPreparer::new(
                spec,
                task,
                &self.background.signal,
            )?)
            .planned_by(PacedPlanner {
                inner: planner,
                pace: &pace,
                planning_time: &spec.planning_time,
            })
            .recorded_by(recorder);
        execute(request, &mut world, &mut Stopwatch::start(self.interrupt))
    }
}

/// Ends a run also when its journal cannot be written.
struct Attentive {
    inner: Stopwatch,
    health: JournalHealth,
}

impl Watcher for Attentive {
    fn elapsed(&mut self) -> Duration {
        self.inner.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        if self.health.has_failed() {
            return ControlFlow::Break(Halt::Cancelled);
        }
        self.inner.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        self.inner.notice(event);
    }
}

/// The exit code of a run. `trace` is the file that has its record.
fn exit(outcome: &RunOutcome, trace: Option<String>) -> Answer {
    let invalid = &outcome.answer.invalid;
    if !invalid.is_empty() {
        let record = trace.map_or_else(String::new, |trace| {
            format!(" The record of the run is {trace}.")
        });
        let label = styled(BAD, "bug");
        output::tell(&format!(
            "{label}: this execution is not valid:\n  {}\nPlease report it, with domain and problem.{record}",
            invalid.join("\n  ")
        ));
        return Ok(Exit::Bug);
    }
    Ok(match outcome.verdict() {
        Verdict::GoalReached => Exit::Yes,
        Verdict::Unsolvable
        | Verdict::NoPlan {
            missing: MissingPlan::NotSearched,
            ..
        } => Exit::No,
        Verdict::ReplanLimit | Verdict::TimeLimit | Verdict::NoPlan { .. } => Exit::Limit,
        Verdict::Interrupted => Exit::Interrupted,
        Verdict::PlannerFailed { why } => {
            return Err(Failure::new(
                format!("the planner failed: {}", escape_control(why)),
                "`elbowroom plan` with the same planner says more; this does not say that there is no plan",
            ));
        }
        Verdict::WorldFailed { why } => {
            return Err(Failure::new(
                format!("the world failed: {}", escape_control(why)),
                "docs/formats/world-protocol.md says what a world must do",
            ));
        }
    })
}
