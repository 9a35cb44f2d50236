//! `elbowroom run`: execute a plan in a world.

mod live;
mod process;
mod realtime;
mod replay;
mod spec;
mod text;
mod trace_file;

use std::sync::Arc;

use elbowroom::answers::RunRequest;
use elbowroom::answers::run::{RunOutcome, run as execute};
use elbowroom::execute::{RunSpec, SpecError, check_vary};
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Recorder, World};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::report::trace;
use elbowroom::sim::WorldModel;

use crate::args::RunArgs;
use crate::clock::Clock;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::stopwatch::Stopwatch;
use crate::words::tame;
use realtime::{Pace, PacedPlanner, Realtime};
use spec::contradiction;
use trace_file::TraceFile;

/// Executes a plan, or plays a stored run back.
pub(crate) fn run(arguments: &RunArgs, output: &mut Output) -> Answer {
    if let Some(path) = &arguments.replay {
        return replay::run(path, arguments.json, output);
    }
    let (Some(domain), Some(problem)) = (&arguments.domain, &arguments.problem) else {
        return Err(Failure::new("DOMAIN and PROBLEM are missing", ""));
    };
    let (spec, world) = spec::of(arguments, domain, problem)?;
    let task = task(&spec, output)?;
    let first = match arguments.plan() {
        Some(path) => Some(input::time_triggered(&task, path, output)?),
        None => None,
    };
    // What is wrong with a file is told before anything is done.
    spec.likelihoods(&task).map_err(contradiction)?;
    if let Some(source) = &world {
        WorldModel::read(source, task.problem())
            .map_err(|wrong| contradiction(SpecError::World(wrong)))?;
    }
    check_vary(&task, &spec.vary).map_err(|error| {
        Failure::new(error, "`elbowroom help envelope` says what --vary can name")
    })?;
    spec.check().map_err(contradiction)?;
    let mut file = TraceFile::open(arguments.trace.as_deref())?;
    let interrupt = Interrupt::listen();
    let task = Arc::new(task);
    let outcome = {
        let mut sink = |line: &str| file.write(line);
        let mut writer = trace::TraceWriter::new(Arc::clone(&task), &mut sink);
        let written = writer.header(&spec);
        written.map_err(|error| Failure::new(format!("cannot write the trace: {error}"), ""))?;
        let mut writer = live::Live::new(&mut writer);
        let job = Job {
            spec: &spec,
            task: &task,
            first,
            interrupt: &interrupt,
        };
        match &arguments.world_process {
            Some(command) => {
                let manners = process::Manners {
                    patience: arguments.answer_within.clone(),
                    is_strict: arguments.strict_world,
                };
                let interrupt = interrupt.clone();
                let mut world = process::ProcessWorld::start(command, &task, manners, interrupt)?;
                let outcome = job.run(&mut world, &mut writer);
                world.stop();
                outcome.map_err(contradiction)?
            }
            None => job.simulated(&mut writer).map_err(contradiction)?,
        }
    };
    let trouble = file.close();
    let shown = if arguments.json {
        output.document(&outcome.answer)
    } else {
        output::print(&text::human(&outcome.report))
    };
    // The run has been what it was, whatever became of its record.
    if let Some(trouble) = trouble {
        output::warn(&trouble);
    }
    shown?;
    exit(outcome.verdict())
}

/// The problem of a specification, with its warnings told.
fn task(spec: &RunSpec, output: &mut Output) -> Result<Task, Failure> {
    let (domain, problem) = (spec.domain.source(), spec.problem.source());
    let read = elbowroom::pddl::read_problem(&domain, &problem);
    let problem = Arc::new(input::with_warnings(read, output)?);
    Ok(Task::new(problem).with_epsilon(spec.epsilon.clone()))
}

/// Everything that a run needs but the world.
struct Job<'a> {
    spec: &'a RunSpec,
    task: &'a Arc<Task>,
    first: Option<TimeTriggeredPlan>,
    interrupt: &'a Interrupt,
}

impl Job<'_> {
    fn run(
        self,
        world: &mut dyn World,
        recorder: &mut dyn Recorder,
    ) -> Result<RunOutcome, SpecError> {
        let request = RunRequest::new(self.spec, self.task)
            .beginning_with(self.first)
            .recorded_by(recorder);
        execute(request, world, &mut Stopwatch::start(self.interrupt))
    }

    /// A run in the world that the specification describes, on a wall clock if it asks for one.
    fn simulated(self, recorder: &mut dyn Recorder) -> Result<RunOutcome, SpecError> {
        let (spec, task) = (self.spec, self.task);
        let model = spec.model(task.problem()).map_err(SpecError::World)?;
        let model = model.unwrap_or_default();
        let mut world = spec.world(&model, task, self.first.as_ref())?;
        let Some(factor) = &spec.realtime else {
            return self.run(world.as_mut(), recorder);
        };
        let pace = Pace::new(factor);
        let begun = Clock::start();
        let clock = || begun.seconds();
        let goes_on = || !self.interrupt.is_requested();
        let planner = spec.planner_for(Some(&model), &clock, &goes_on)?;
        let mut world = Realtime {
            inner: world.as_mut(),
            pace: &pace,
            interrupt: self.interrupt,
        };
        let request = RunRequest::new(spec, task)
            .beginning_with(self.first)
            .planned_by(PacedPlanner {
                inner: planner,
                pace: &pace,
                planning_time: &spec.planning_time,
            })
            .recorded_by(recorder);
        execute(request, &mut world, &mut Stopwatch::start(self.interrupt))
    }
}

pub(super) fn exit(verdict: &Verdict) -> Answer {
    Ok(match verdict {
        Verdict::GoalReached => Exit::Yes,
        Verdict::Unsolvable | Verdict::NoPlan { .. } => Exit::No,
        Verdict::ReplanLimit | Verdict::TimeLimit => Exit::Limit,
        Verdict::Interrupted => Exit::Interrupted,
        Verdict::WorldFailed { why } => {
            return Err(Failure::new(
                format!("the world failed: {}", tame(why)),
                "docs/formats/world-protocol.md says what a world must do",
            ));
        }
    })
}
