//! `elbowroom run`: execution of a plan in a world.

mod page;
mod progress_line;
mod replay;
pub(super) mod resume;
pub(super) mod spec;
mod text;
pub(super) mod trace_file;
mod viewers;

use std::cell::OnceCell;
use std::path::Path;
use std::sync::Arc;

use elbowroom::RoundingRule;
use elbowroom::answers::run::RunOutcome;
use elbowroom::execute::{NamedText, RunInputs, RunSpec, WorldNames, check_vary};
use elbowroom::execution::Ending;
use elbowroom::execution::run::{MissingPlan, Verdict};
use elbowroom::model::{Task, TimeTriggeredPlan};
use elbowroom::num::Rational;
use elbowroom::sim::{FailureTime, WorldModel};
use elbowroom_executive::Error;
use elbowroom_executive::background_planner::BackgroundSettings;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::completion_signal::CompletionSignal;
use elbowroom_executive::http::AccessControl;
use elbowroom_executive::journal::{JournalFile, Segments};
use elbowroom_executive::learning::{Learner, Learning};
use elbowroom_executive::messages::escape_control;
use elbowroom_executive::operator::OperatorInterface;
use elbowroom_executive::process_world::{ProcessLimits, check_program};
use elbowroom_executive::run::{JournaledOutcome, RunAssembly, RunError, RunHost};
use elbowroom_executive::trace_buffer::TraceBuffer;

use crate::args::RunArgs;
use crate::calendar::with_calendar;
use crate::exit::{Answer, Exit, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::terminal::{ERROR, styled};
use crate::time_limit::Stopwatch;
use page::Page;
use progress_line::ProgressLine;
use resume::ResumeHost;
use spec::contradiction_failure;
use trace_file::TraceFile;
use viewers::Viewers;

/// Executes a plan, or replays a stored run.
pub(crate) fn run(arguments: &RunArgs, output: &mut Output) -> Answer {
    if let Some(path) = &arguments.replay {
        return replay::run(path, arguments.json, output);
    }
    if let Some(path) = &arguments.resume {
        let host = resume::StandaloneHost::new(arguments);
        let answer = resume::run(path, arguments, &host, output);
        host.close();
        return answer;
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
        let (problem, at) = with_calendar((&arguments.calendar, factor), domain, problem, output)?;
        since = at;
        Ok((&problem).into())
    };
    let (mut spec, names) = spec::of(arguments, domain, problem)?;
    spec.is_interactive = arguments.token.is_some();
    let (inputs, first) = checked(arguments, spec, &names, output)?;
    let interrupt = Interrupt::listen_with_world();
    let journal = journal(arguments, RESUME)?;
    let page = Page::open(arguments, &inputs, &interrupt)?;
    let job = Job {
        journal,
        started: &|| (),
        clock: since,
        inputs: &inputs,
        first_plan: first,
        interrupt: &interrupt,
        operator: &page.operator,
    };
    let answer = job.execute(arguments, output);
    page.close();
    answer
}

/// Command that resumes a run that ends with its goal.
pub(super) const RESUME: &str = "elbowroom run --resume";

/// Command that resumes an executive.
pub(super) const RESUME_SERVE: &str = "elbowroom serve --resume";

/// Creates the journal of the arguments, if there is one.
///
/// # Errors
/// When the world process does not exist, or the file cannot be created.
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
        memory_limit: arguments.planner_memory.map(|megabytes| megabytes << 20),
    }
}

/// Reads the token of the arguments, if there is one.
///
/// # Errors
/// When the file cannot be read, other users can read it, or it does not contain a token.
pub(super) fn access(
    arguments: &RunArgs,
    interrupt: &Interrupt,
) -> Result<Option<AccessControl>, Error> {
    let token = arguments.token.as_ref();
    token
        .map(|path| AccessControl::read(path, interrupt.stop().clone()))
        .transpose()
}

/// Reads the texts of a specification, and the first plan if one is given. Errors in files are
/// reported before the run starts.
pub(super) fn checked(
    arguments: &RunArgs,
    mut spec: RunSpec,
    names: &WorldNames,
    output: &mut Output,
) -> Result<(RunInputs, Option<TimeTriggeredPlan>), Failure> {
    let task = Arc::new(task(&spec, output)?);
    spec::fit_model(arguments, &mut spec, task.problem());
    let first = match arguments.plan() {
        Some(path) => Some(input::time_triggered(
            &task,
            path,
            &RoundingRule::with_tolerance(arguments.tolerance.clone()),
            input::FIXED_TIMES_ADVICE,
            output,
        )?),
        None => None,
    };
    let inputs = RunInputs::of(spec, task, names).map_err(contradiction_failure)?;
    check_vary(inputs.task(), &inputs.spec().vary).map_err(|error| {
        Failure::new(
            error,
            "`elbowroom help envelope` lists the quantities for --vary",
        )
    })?;
    inputs.spec().check_new().map_err(contradiction_failure)?;
    Ok((inputs, first))
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
        let ends = text::RunEnd {
            has_lost_journal: has_lost,
            is_persistent: spec.is_persistent,
        };
        output::print(&text::render(&outcome.answer, &outcome.report, ends))?;
        let is_given = arguments.plan().is_some() && outcome.report.starts == 0;
        if let Verdict::NoPlan { why, .. } = outcome.verdict()
            && is_given
            && why.starts_with("the plan is not valid")
        {
            input::advise_repair();
            input::note("without PLAN, the planner makes a plan");
        }
        Ok(())
    }
}

/// Prints the outcome of a run with a journal.
pub(super) fn print_outcome(
    asked: (&RunArgs, &RunSpec),
    JournaledOutcome {
        mut outcome,
        journal_failure,
    }: JournaledOutcome,
    output: &mut Output,
) -> Answer {
    let Some(why) = journal_failure else {
        show(asked, &outcome, false, output)?;
        let journal = asked.0.journal.as_ref().or(asked.0.resume.as_ref());
        return exit(&outcome, journal.map(|path| path.display().to_string()));
    };
    // This verdict results from the failure of the journal. No stop was requested.
    let has_lost = *outcome.verdict() == Verdict::Interrupted;
    if has_lost {
        outcome.answer.report.why = Some(format!("the journal cannot be written: {why}"));
    }
    show(asked, &outcome, has_lost, output)?;
    let resume = if asked.1.is_persistent {
        RESUME_SERVE
    } else {
        RESUME
    };
    Err(Failure::new(
        format!("the journal cannot be written ({why}), so the run was shut down"),
        format!("free some disk space; `{resume}` continues from the journal"),
    ))
}

/// Reads the problem of a specification and prints its warnings.
pub(super) fn task(spec: &RunSpec, output: &mut Output) -> Result<Task, Failure> {
    input::with_warnings(spec.read_task(), output)
}

/// Starts learning from the journal at `path` if the arguments ask for it.
fn learning(arguments: &RunArgs, path: &Path) -> Result<Option<Learning>, Failure> {
    let Some(folder) = &arguments.learn else {
        return Ok(None);
    };
    let learner = Learner::new(folder, path, output::warnings())?;
    Ok(Some(Learning::start(learner)))
}

/// Returns the limits of a world process.
fn limits(arguments: &RunArgs) -> ProcessLimits {
    ProcessLimits {
        answer_timeout: arguments.answer_within.clone(),
        is_strict: arguments.strict_world,
        restarts: arguments.restart_world,
    }
}

/// Returns the failure of a run without an outcome.
fn failure(error: RunError) -> Failure {
    match error {
        RunError::Problem(mistakes) => mistakes.into(),
        RunError::Spec(error) => contradiction_failure(error),
        RunError::Failed(error) => error.into(),
    }
}

/// Host of a run on the command line.
struct CommandHost<'a> {
    arguments: &'a RunArgs,
    interrupt: &'a Interrupt,
    /// The viewers, once they are open.
    viewers: OnceCell<Viewers<'a>>,
    /// Called when execution begins.
    started: &'a dyn Fn(),
    /// Support for operators of a resumed run.
    resume: Option<&'a dyn ResumeHost>,
}

impl CommandHost<'_> {
    /// Closes the viewers after a run with an outcome.
    fn close<T, E>(self, outcome: Result<T, E>) -> Result<T, E> {
        if let (Ok(_), Some(views)) = (&outcome, self.viewers.into_inner()) {
            views.close();
        }
        outcome
    }
}

impl RunHost for CommandHost<'_> {
    fn operator(&self, inputs: &RunInputs) -> Result<OperatorInterface, Error> {
        match self.resume {
            Some(host) => host.operator(inputs, self.interrupt),
            None => Ok(OperatorInterface::default()),
        }
    }

    fn segments(&self) -> Option<Segments> {
        self.resume.and_then(ResumeHost::segments)
    }

    fn open_viewers(
        &self,
        spec: &RunSpec,
        task: &Arc<Task>,
        _: &OperatorInterface,
    ) -> Result<Option<TraceBuffer>, Error> {
        let views = Viewers::open(self.arguments, spec, task)?;
        Ok(self.viewers.get_or_init(|| views).buffer().cloned())
    }

    fn started(&self) {
        (self.started)();
    }
}

/// Everything that a run needs except the world.
pub(super) struct Job<'a> {
    pub(super) inputs: &'a RunInputs,
    pub(super) first_plan: Option<TimeTriggeredPlan>,
    pub(super) interrupt: &'a Interrupt,
    pub(super) operator: &'a OperatorInterface,
    /// The journal, still empty, if the run has one.
    pub(super) journal: Option<JournalFile>,
    /// Called when execution begins. The first record is on the disk if there is a journal.
    pub(super) started: &'a dyn Fn(),
    /// Clock that started at time 0, if that is a date; otherwise time 0 is the start of the run.
    pub(super) clock: Option<Clock>,
}

impl Job<'_> {
    /// Executes the run of the arguments, and returns its exit code.
    pub(super) fn execute(self, arguments: &RunArgs, output: &mut Output) -> Answer {
        let (spec, interrupt) = (self.inputs.spec(), self.interrupt);
        let mut line = ProgressLine::new();
        let journal = arguments.journal.as_deref();
        let learning = journal
            .map(|path| learning(arguments, path))
            .transpose()?
            .flatten();
        let mut learns = learning.as_ref().map(Learning::observer);
        let run = RunAssembly {
            inputs: self.inputs,
            first_plan: self.first_plan,
            embedded: None,
            operator: self.operator,
            background: background(arguments, interrupt),
            limits: limits(arguments),
            since: self.clock,
            observer: Some(Box::new(move |entry| {
                line.update(entry);
                if let Some(learns) = &mut learns {
                    learns(entry);
                }
            })),
            warnings: output::warnings(),
        };
        let host = CommandHost {
            arguments,
            interrupt,
            viewers: OnceCell::new(),
            started: self.started,
            resume: None,
        };
        let mut watcher = Stopwatch::start(interrupt);
        if let Some(file) = self.journal {
            let outcome = run.execute_journaled(file, &host, &mut watcher);
            if let Some(learning) = learning {
                learning.finish();
            }
            let outcome = host.close(outcome).map_err(failure)?;
            return print_outcome((arguments, spec), outcome, output);
        }
        let mut file = TraceFile::open(arguments.trace.as_deref())?;
        let outcome = run.execute(&mut |line| file.write(line), &host, &mut watcher);
        let outcome = host.close(outcome).map_err(failure)?;
        let is_valid = outcome.answer.invalid.is_empty();
        let trace = (!is_valid).then(|| file.of_invalid_run()).flatten();
        let trouble = file.close();
        let shown = show((arguments, spec), &outcome, false, output);
        // The run is complete, although its record is not.
        if let Some(trouble) = trouble {
            output::warn(&trouble);
        }
        shown?;
        if !arguments.json {
            advise_undone(self.inputs.simulation(), &outcome);
        }
        exit(&outcome, trace)
    }
}

/// Prints a note if the goal became unreachable in a simulation whose failed actions keep the effects
/// of their starts, because world files often forget `undone`.
fn advise_undone(world: Option<&WorldModel>, outcome: &RunOutcome) {
    let (Some(world), Verdict::Unsolvable) = (world, outcome.verdict()) else {
        return;
    };
    let mut executed = outcome.report.executed.iter();
    let failed = executed.find(|executed| {
        let has_failed = matches!(executed.ending, Some(Ending::Failed { .. }));
        let rule = world.failure_rule(&executed.step.action.name);
        has_failed && rule.is_some_and(|rule| !rule.is_undone && rule.when != FailureTime::AtStart)
    });
    if let Some(failed) = failed {
        let name = &failed.step.action.name;
        input::note(&format!(
            "{name} failed and keeps the effects of its start; `undone = true` in its [[failure]] \
             section reverts them"
        ));
    }
}

/// Returns the exit code of a run. `trace` is the file with its record.
fn exit(outcome: &RunOutcome, trace: Option<String>) -> Answer {
    let invalid = &outcome.answer.invalid;
    if !invalid.is_empty() {
        let record = trace.map_or_else(String::new, |trace| {
            format!(" The trace of the run is {trace}.")
        });
        let label = styled(ERROR, "bug");
        output::print_to_stderr(&format!(
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
                "run `elbowroom plan` with the same planner for details; a plan may still exist",
            ));
        }
        Verdict::WorldFailed { why } => {
            return Err(Failure::new(
                format!("the world failed: {}", escape_control(why)),
                "docs/reference/formats/world-protocol.md describes the requirements on a world",
            ));
        }
    })
}
