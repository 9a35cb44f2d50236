//! Recovery: resumes a run from its journal after a crash.
//!
//! All decisions of a run follow from the reports of the world and the answers of the planner, which the journal
//! contains. So the run is replayed to the end of the journal without a message to the world; then the world itself
//! is started again. `docs/formats/journal.md` has the rules for actions that were running.

mod elapsed;
mod journal_replay;
mod running_actions;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elbowroom::answers::run::run as execute;
use elbowroom::answers::{RunRequest, Watcher};
use elbowroom::execute::RunSpec;
use elbowroom::execution::{
    Command, Ending, Event, Observation, Passage, Ticket, World, WorldError,
};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;
use elbowroom::report::trace::{Line, ReplayWorld, Stored};

use crate::background_planner::{BackgroundPlanner, BackgroundSettings};
use crate::background_preparer::BackgroundPreparer;
use crate::belief_updates::BeliefUpdates;
use crate::clock::Clock;
use crate::error::{Error, WarningSink};
use crate::journal::{DAMAGE_ADVICE, Journal, JournalFile, WallTime, is_journal};
use crate::journaling::{JournalHealth, JournalWriter, JournaledWorld};
use crate::operator::InteractiveWorld;
use crate::process_world::{ProcessLimits, ProcessWorld};
use crate::run::{JournaledOutcome, RunError, RunHost, ViewedRecorder, both};
use elapsed::Elapsed;
use journal_replay::{JournalReplay, ReplayRecorder, ReplayWatcher, ResumedPlanner};
use running_actions::RunningActions;

/// Run whose program has died, as its journal describes it.
pub struct InterruptedRun {
    path: PathBuf,
    journal: Journal,
    /// Length of the file in bytes when it was read.
    length: u64,
    stored: Stored,
    spec: RunSpec,
    /// Command of the world process.
    command: String,
}

/// Settings for a resumed run, which its journal does not contain.
pub struct ResumeSettings<'a> {
    /// The problem of the specification, with a new table of facts.
    pub task: &'a Arc<Task>,
    /// Background planning, with the stop request of the run.
    pub background: BackgroundSettings,
    /// Limits of the world process.
    pub limits: ProcessLimits,
    /// Receiver of warnings.
    pub warnings: WarningSink,
}

impl InterruptedRun {
    /// Reads a journal: its path, its text, and the length of the file in bytes.
    ///
    /// # Errors
    /// When the text is no journal, the journal is damaged, or its run is finished.
    pub fn read(path: &Path, text: &str, length: u64) -> Result<Self, Error> {
        let name = path.display().to_string();
        if !is_journal(text) {
            return Err(Error::new(
                format!("{name} is no journal of a run"),
                "`elbowroom run --journal` writes them; a trace can be played back with --replay",
            ));
        }
        let mut journal =
            Journal::read(text).map_err(|why| unreadable(&name, &why, DAMAGE_ADVICE))?;
        if journal.text.is_empty() {
            let is_cut_off = !text.contains('\n');
            let (why, advice) = if is_cut_off {
                let why = "it ends before its first record does, so that nothing was ever told to the world";
                (why, "remove it, and begin the run again")
            } else {
                ("its first record is damaged", DAMAGE_ADVICE)
            };
            return Err(unreadable(&name, why, advice));
        }
        let read = |journal: &Journal| {
            let stored = Stored::read(&journal.text);
            stored.map_err(|error| unreadable(&name, &error.to_string(), OTHER_VERSION))
        };
        let mut stored = read(&journal)?;
        // A world that has died may be started again.
        if let Some(Line::Over(report)) = stored.lines.last()
            && report.verdict == WORLD_FAILED
        {
            journal = journal.without_last();
            stored = read(&journal)?;
        }
        if let Some(Line::Over(report)) = stored.lines.last()
            && !WITHOUT_PLAN.contains(&report.verdict.as_str())
        {
            return Err(Error::new(
                format!("the run of {name} is over: {}", report.verdict),
                "there is nothing to go on with; `elbowroom report` shows what was done",
            ));
        }
        let spec = stored.header();
        let spec: RunSpec =
            spec.map_err(|error| Error::new(format!("{name}, {error}"), OTHER_VERSION))?;
        let Some(command) = spec.world_process.clone() else {
            return Err(unreadable(&name, "its world was no process", OTHER_VERSION));
        };
        Ok(Self {
            path: path.to_owned(),
            journal,
            length,
            stored,
            spec,
            command,
        })
    }

    /// Returns the specification of the run.
    pub fn spec(&self) -> &RunSpec {
        &self.spec
    }

    /// Sets the number of threads of the planner, which does not change its plans.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.spec.threads = threads;
        self
    }

    /// Replays the journal, starts the world again, and continues the run.
    ///
    /// # Errors
    /// When the journal is written by another program or cannot be written, its replay deviates, or the host rejects
    /// the run.
    pub fn resume(
        self,
        settings: ResumeSettings<'_>,
        host: &dyn RunHost,
        watcher: &mut (dyn Watcher + Send),
    ) -> Result<JournaledOutcome, RunError> {
        let Self {
            path,
            journal,
            length,
            stored,
            spec,
            command,
        } = self;
        let ResumeSettings {
            task,
            background,
            limits,
            warnings,
        } = settings;
        let name = path.display().to_string();
        let wrong = |error: &dyn fmt::Display| unreadable(&name, &error.to_string(), OTHER_VERSION);
        // Before any other fact is mentioned: the table of facts has to be as it was.
        let snapshot = stored.snapshot().map_err(|error| wrong(&error))?;
        let stand = snapshot.as_ref().map(|it| it.stand(task)).transpose();
        let stand = stand.map_err(|why| wrong(&format!("line 2: {why}")))?;
        let now = snapshot.as_ref().map(|it| it.now().clone());
        let first = spec.has_plan.then(|| stored.first_plan(task));
        let first = first.transpose().map_err(|error| wrong(&error))?.flatten();
        let mut file =
            JournalFile::reopen(&path, &journal, length)?.with_rotation(host.segments(), &warnings);
        let operator = host.operator(&spec, task)?;
        if let Some(snapshot) = &snapshot {
            operator.begin_at(snapshot);
        }
        let stop = &background.stop;
        let health = JournalHealth::default();
        let beliefs = BeliefUpdates::default();
        let replay = Arc::new(JournalReplay::new(&stored));
        let buffer = host.open_viewers(&spec, task, &operator)?;
        let outcome = {
            let recorder = ReplayRecorder {
                replay: Arc::clone(&replay),
                task: Arc::clone(task),
                writer: JournalWriter::new(task, &mut file, &health, operator.queue()),
            };
            let recorder = operator.publishing(recorder, task, true);
            let begun = Clock::start();
            let clock = || begun.seconds();
            let continues = || !stop.is_requested();
            let planner = spec.planner_for(task, None, &clock, &continues)?;
            let planner = Box::new(BackgroundPlanner::new(planner, &spec, &background));
            let request = RunRequest::new(&spec, task)
                .beginning_with(first)
                .standing(stand)
                .reopened(stored.reopened() + usize::from(stored.is_complete()))
                .planned_by(ResumedPlanner::new(&stored, planner))
                .prepared_by(BackgroundPreparer::new(&spec, task, &background.signal)?)
                .told_to(both(operator.listener(), beliefs.listener()))
                .recorded_by(ViewedRecorder::new(recorder, task, buffer, None));
            let world = ResumedWorld {
                journal: ReplayWorld::new(&stored, task),
                left: stored.lines.iter().filter(|line| is_answer(line)).count(),
                replay: Arc::clone(&replay),
                running: RunningActions::of(&stored, snapshot.as_ref()),
                elapsed: Elapsed::of(&journal, &stored, snapshot.as_ref()),
                launch: Launch {
                    command,
                    task,
                    limits,
                    stop: stop.clone(),
                    warnings,
                },
                process: None,
                beliefs,
                last: now.unwrap_or_default(),
                shift: Rational::ZERO,
                news: None,
            };
            let world = JournaledWorld::new(world, health.clone());
            let signal = &background.signal;
            let mut world =
                InteractiveWorld::new(world, &operator, task, stop, signal, &Rational::ONE)
                    .with_running(running_actions::open(snapshot.as_ref()))
                    .live_when(|| replay.is_over());
            let mut watcher = ReplayWatcher {
                inner: watcher,
                replay: Arc::clone(&replay),
                health,
            };
            let outcome = execute(request, &mut world, &mut watcher);
            if let Some(process) = world.into_inner().into_inner().process {
                process.stop();
            }
            outcome?
        };
        if let Some(line) = replay.difference() {
            return Err(RunError::Failed(deviates(&name, line)));
        }
        Ok(JournaledOutcome {
            outcome,
            journal_failure: file.failure(),
        })
    }
}

/// Advice for an intact journal that cannot be interpreted.
const OTHER_VERSION: &str = "it may be of another version of this program: go on with that one, or begin a new \
                             run with another journal";

/// Returns the error for a journal that cannot be resumed.
fn unreadable(name: &str, message: &str, advice: &str) -> Error {
    Error::new(format!("the journal {name}: {message}"), advice)
}

/// Returns the error for a replay that deviates from the journal.
fn deviates(name: &str, line: usize) -> Error {
    Error::new(
        format!(
            "the journal {name} does not lead to the same decisions, from line {line} on; nothing was \
             told to the world"
        ),
        OTHER_VERSION,
    )
}

/// Verdict of a run whose world has failed.
const WORLD_FAILED: &str = "world-failed";

/// Verdicts of a run without a plan, which can be resumed. Earlier versions used the first for failed planners as
/// well.
const WITHOUT_PLAN: [&str; 2] = ["no-plan", "planner-failed"];

/// Returns `true` for an answer of the world.
fn is_answer(line: &Line) -> bool {
    matches!(line, Line::Passed(_) | Line::Looked(_))
}

/// Arguments for the start of the world process.
struct Launch<'a> {
    command: String,
    task: &'a Arc<Task>,
    limits: ProcessLimits,
    stop: Stop,
    warnings: WarningSink,
}

/// World that replays the journal, then starts the process.
struct ResumedWorld<'a> {
    journal: ReplayWorld,
    /// Number of answers that the journal still has.
    left: usize,
    replay: Arc<JournalReplay>,
    running: RunningActions,
    /// Time since the end of the journal.
    elapsed: Elapsed,
    launch: Launch<'a>,
    process: Option<ProcessWorld>,
    beliefs: BeliefUpdates,
    /// Current time of the run.
    last: Rational,
    /// Offset that is added to the times of a world that restarts at time 0.
    shift: Rational,
    /// Outcome of the actions that were running, until the run has received it.
    news: Option<Vec<Observation>>,
}

impl ResumedWorld<'_> {
    /// Returns the process. Starts it at the first call, and requests the outcome of running actions.
    fn process(&mut self) -> Result<&mut ProcessWorld, WorldError> {
        if self.replay.difference().is_some() {
            return Err(WorldError::new("the journal leads to other decisions"));
        }
        if self.process.is_none() {
            let launch = &self.launch;
            let resumed = self.running.message(&self.last);
            let world = ProcessWorld::resume(
                &launch.command,
                launch.task,
                launch.limits.clone(),
                launch.stop.clone(),
                (&resumed, self.running.given),
            );
            let world = world.map_err(|error| WorldError::new(error.message()))?;
            self.process = Some(world.with_beliefs(self.beliefs.clone()));
            self.reconcile()?;
        }
        self.process
            .as_mut()
            .ok_or_else(|| WorldError::new("the world is not there"))
    }

    /// Requests the outcome of running actions, and repeats cancellations.
    fn reconcile(&mut self) -> Result<(), WorldError> {
        let Some(world) = &mut self.process else {
            return Ok(());
        };
        let tickets: Vec<u64> = self.running.open.keys().copied().collect();
        let (passage, knows) = world.recall(&tickets)?;
        if !knows {
            // The clock of the world restarts at 0. That of the run has advanced with the wall clock, except for simulations.
            self.shift = match self.elapsed.until(WallTime::now()) {
                Ok(elapsed) => &self.last + elapsed - &passage.now,
                Err(why) => {
                    self.launch.warnings.warn(&format!(
                        "the run resumes at {} s, the time of the last record of its journal: {why}",
                        self.last.to_decimal(3)
                    ));
                    self.last.clone()
                }
            };
        }
        self.last = (&passage.now + &self.shift).max(self.last.clone());
        let mut news = shifted(passage.observations, &self.shift);
        for (ticket, open) in &self.running.open {
            let is_told = news.iter().any(|it| is_about(&it.event, *ticket));
            if !(knows && is_told) {
                let why = if knows {
                    "the world knows nothing of it after the restart"
                } else {
                    "it was under way when the run was cut off, and the world cannot say what became of it"
                };
                news.push(Observation {
                    time: self.last.clone(),
                    event: Event::Ended {
                        ticket: Ticket(*ticket),
                        ending: Ending::Failed {
                            why: why.to_owned(),
                        },
                        measured: Vec::new(),
                    },
                });
            }
            // The world may have received the cancellation already. An action that it does not know may still run.
            if open.is_cancelled || !is_told {
                let ticket = Ticket(*ticket);
                world.command(&self.last, &Command::Cancel { ticket })?;
            }
        }
        self.news = Some(news);
        Ok(())
    }
}

fn is_about(event: &Event, about: u64) -> bool {
    match event {
        Event::Started { ticket, .. } | Event::Ended { ticket, .. } => ticket.0 == about,
        _ => false,
    }
}

fn shifted(mut observations: Vec<Observation>, shift: &Rational) -> Vec<Observation> {
    for observation in &mut observations {
        observation.time = &observation.time + shift;
    }
    observations
}

impl World for ResumedWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        if self.replay.has_last() {
            return Ok(());
        }
        self.process()?;
        let told = (now - &self.shift).max(Rational::ZERO);
        if self.news.is_none() {
            return self.process()?.command(&told, command);
        }
        // The decision was made before the outcome of running actions was known.
        match command {
            Command::Cancel { .. } => self.process()?.command(&told, command),
            Command::Start { ticket, .. } => {
                let why = "it was not started: the run was cut off just then".to_owned();
                let time = self.last.clone();
                let event = Event::Ended {
                    ticket: *ticket,
                    ending: Ending::Failed { why },
                    measured: Vec::new(),
                };
                let news = self.news.get_or_insert_default();
                news.push(Observation { time, event });
                Ok(())
            }
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        if let Some(left) = self.left.checked_sub(1) {
            self.left = left;
            let passage = self.journal.wait(until)?;
            self.last = passage.now.clone().max(self.last.clone());
            return Ok(passage);
        }
        self.process()?;
        if let Some(observations) = self.news.take() {
            let now = self.last.clone();
            return Ok(Passage { now, observations });
        }
        let shift = self.shift.clone();
        let passage = self.process()?.wait(&(until - &shift))?;
        Ok(Passage {
            now: &passage.now + &shift,
            observations: shifted(passage.observations, &shift),
        })
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        if let Some(left) = self.left.checked_sub(1) {
            self.left = left;
            return self.journal.look(facts, fluents);
        }
        let mut seen = shifted(self.process()?.look(facts, fluents)?, &self.shift.clone());
        if let Some(mut news) = self.news.take() {
            news.append(&mut seen);
            return Ok(news);
        }
        Ok(seen)
    }
}
