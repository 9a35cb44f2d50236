//! Recovery: resumes a run from its journal after a crash.
//!
//! All decisions of a run follow from the reports of the world and the answers of the planner, which the journal
//! contains. So the run is replayed to the end of the journal without a message to the world; then the world itself
//! is started again. `docs/reference/formats/journal.md` has the rules for actions that were running.

mod elapsed;
mod journal_replay;

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use elbowroom::answers::Observer;
use elbowroom::answers::run::run as execute;
use elbowroom::execute::{RunInputs, RunSpec};
use elbowroom::execution::run::Verdict;
use elbowroom::execution::{Command, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::trace::schema::ObservationLine;
use elbowroom::report::trace::{Line, ReplayWorld, SnapshotLine, Stored};
use serde_json::Value;

use crate::background_planner::BackgroundSettings;
use crate::belief_updates::BeliefUpdates;
use crate::clock::Clock;
use crate::decorators::Decorators;
use crate::embedded_world::EmbeddedWorld;
use crate::error::{Error, WarningSink};
use crate::interface::Status;
use crate::journal::{DAMAGE_ADVICE, Journal, JournalFile, WallTime, is_journal};
use crate::journaling::{JournalHealth, JournalWriter, JournaledWorld};
use crate::process_world::ProcessLimits;
use crate::restartable_world::RestartableWorld;
use crate::run::{EntryObserver, JournaledOutcome, RunError, RunHost};
use crate::running_actions::{self, RunningActions};
use crate::world_connection::{Launch, WorldSource};
use elapsed::Elapsed;
use journal_replay::{DeferredStop, JournalReplay, ReplayRecorder, ReplayWatcher, ResumedPlanner};

/// Run whose program has died, as its journal describes it.
pub struct InterruptedRun {
    path: PathBuf,
    journal: Journal,
    /// Length of the file in bytes when it was read.
    length: u64,
    stored: Stored,
    spec: RunSpec,
    /// The journal; `None` until it is opened.
    file: Option<JournalFile>,
}

/// Run of a journal.
pub enum JournaledRun {
    /// It can be resumed.
    Interrupted(Box<InterruptedRun>),
    /// It has reached its goal. Contains the last line of its trace.
    Achieved(Value),
}

/// Settings for a resumed run, which its journal does not contain.
pub struct ResumeSettings<'a> {
    /// The specification of the journal, with its texts read, and a new table of facts.
    pub inputs: &'a RunInputs,
    /// The world, if it is an object in this process.
    pub embedded: Option<&'a mut dyn EmbeddedWorld>,
    /// Background planning, with the stop request of the run.
    pub background: BackgroundSettings,
    /// Limits of the world process.
    pub limits: ProcessLimits,
    /// Called for each entry after it is recorded.
    pub observer: Option<EntryObserver<'a>>,
    /// Receiver of warnings.
    pub warnings: WarningSink,
}

impl InterruptedRun {
    /// Reads a journal: its path, its text, and the length of the file in bytes.
    ///
    /// # Errors
    /// When the text is not a journal, the journal is damaged, or its run is finished and has not
    /// reached its goal.
    pub fn read(path: &Path, text: &str, length: u64) -> Result<JournaledRun, Error> {
        let name = path.display().to_string();
        if !is_journal(text) {
            return Err(Error::new(
                format!("{name} is not the journal of a run"),
                "`elbowroom run --journal` writes journals; a trace can be replayed with --replay",
            ));
        }
        let mut journal = Journal::read(text)
            .map_err(|why| unreadable_journal_error(&name, &why, DAMAGE_ADVICE))?;
        if journal.text.is_empty() {
            let is_cut_off = !text.contains('\n');
            let (why, advice) = if is_cut_off {
                let why = "it ends within its first record; the world has received no request";
                (why, "remove it, and start the run again")
            } else {
                ("its first record is damaged", DAMAGE_ADVICE)
            };
            return Err(unreadable_journal_error(&name, why, advice));
        }
        let read = |journal: &Journal| {
            let stored = Stored::read(&journal.text);
            stored.map_err(|error| other_version_error(&name, &error))
        };
        let mut stored = read(&journal)?;
        if let Some(end) = end_by_world(&stored.lines) {
            journal = journal.truncated(stored.first_number() - 1 + end);
            stored = read(&journal)?;
        }
        if let Some(Line::Over(report)) = stored.lines.last()
            && !WITHOUT_PLAN.contains(&report.verdict.as_str())
        {
            if report.verdict == Verdict::GoalReached.name() {
                let report = serde_json::to_value(report).unwrap_or_default();
                return Ok(JournaledRun::Achieved(report));
            }
            return Err(Error::new(
                format!("the run of {name} is over: {}", report.verdict),
                "it cannot be resumed; `elbowroom report` shows it",
            ));
        }
        let spec = stored.header();
        let spec: RunSpec =
            spec.map_err(|error| Error::new(format!("{name}, {error}"), OTHER_VERSION))?;
        if spec.world_process.is_none() {
            return Err(unreadable_journal_error(
                &name,
                "its world was not a process",
                OTHER_VERSION,
            ));
        }
        Ok(JournaledRun::Interrupted(Box::new(Self {
            path: path.to_owned(),
            journal,
            length,
            stored,
            spec,
            file: None,
        })))
    }

    /// Returns the specification of the run.
    pub fn spec(&self) -> &RunSpec {
        &self.spec
    }

    /// Returns the names of the goals that were given to the run.
    pub(crate) fn goal_names(&self) -> Vec<String> {
        let snapshot = self.stored.snapshot().ok().flatten();
        let earlier = snapshot.iter().flat_map(SnapshotLine::goal_names);
        let lines = self.stored.lines.iter().filter_map(|line| match line {
            Line::Passed(line) => Some(&line.observations),
            Line::Looked(line) => Some(&line.observations),
            _ => None,
        });
        let given = lines.flatten().filter_map(|line| match line {
            ObservationLine::Goal { name, .. } => Some(name.as_str()),
            _ => None,
        });
        earlier.chain(given).map(str::to_owned).collect()
    }

    /// Opens the journal, so that no other program resumes the run. [`InterruptedRun::resume`] does so otherwise.
    ///
    /// # Errors
    /// When the journal cannot be written, or is written by another program.
    pub fn open_exclusively(mut self) -> Result<Self, Error> {
        self.file = Some(JournalFile::reopen(&self.path, &self.journal, self.length)?);
        Ok(self)
    }

    /// Sets the number of threads of the planner, which does not change its plans.
    #[must_use]
    pub fn with_threads(mut self, threads: usize) -> Self {
        self.spec.threads = threads;
        self
    }

    /// Replays the journal, connects the world again, and continues the run.
    ///
    /// # Errors
    /// When the journal is written by another program or cannot be written, its replay deviates, or the host rejects
    /// the run.
    pub fn resume(
        self,
        settings: ResumeSettings<'_>,
        host: &dyn RunHost,
        watcher: &mut (dyn Observer + Send),
    ) -> Result<JournaledOutcome, RunError> {
        let Self {
            path,
            journal,
            length,
            stored,
            spec: _,
            file,
        } = self;
        let ResumeSettings {
            inputs,
            embedded,
            background,
            limits,
            observer,
            warnings,
        } = settings;
        let (spec, task) = (inputs.spec(), inputs.task());
        let name = path.display().to_string();
        let source = WorldSource::of(spec, embedded)?;
        let wrong = |error: &dyn fmt::Display| other_version_error(&name, error);
        // Before any other fact is mentioned: the table of facts has to be as it was.
        let snapshot = stored.snapshot().map_err(|error| wrong(&error))?;
        let stand = snapshot.as_ref().map(|it| it.restored(task)).transpose();
        let stand = stand.map_err(|why| wrong(&format!("line 2: {why}")))?;
        let now = snapshot.as_ref().map(|it| it.now().clone());
        let first = spec.has_plan.then(|| stored.first_plan(task));
        let first = first.transpose().map_err(|error| wrong(&error))?.flatten();
        let file = file.map_or_else(|| JournalFile::reopen(&path, &journal, length), Ok)?;
        let mut file = file.with_rotation(host.segments(), &warnings);
        let operator = host.operator(inputs)?;
        if let Some(snapshot) = &snapshot {
            operator.begin_at(snapshot);
        }
        if let Some(status) = operator.status() {
            status.set_replayed(true);
        }
        let stop = &background.stop;
        let health = JournalHealth::default();
        let beliefs = BeliefUpdates::default();
        let replay = Arc::new(JournalReplay::new(&stored));
        let buffer = host.open_viewers(spec, task, &operator)?;
        let decorators = Decorators::new(inputs, &operator, &background);
        let outcome = {
            let mut deferred_stop = DeferredStop::uninstall();
            deferred_stop.install_after(&replay);
            let recorder = ReplayRecorder {
                stop: deferred_stop,
                replay: Arc::clone(&replay),
                task: Arc::clone(task),
                writer: JournalWriter::new(task, &mut file, &health, &operator),
            };
            let mut recorder = decorators.recorder(recorder, true, buffer, observer);
            let clock = Clock::stopwatch();
            let continues = || !stop.is_requested();
            let planner = Box::new(decorators.planner(&clock, &continues)?);
            let planner = ResumedPlanner::new(&stored, planner);
            let execution = decorators
                .execution(first, planner, beliefs.listener())?
                .resume_from(stand)
                .with_restarts(stored.restart_count() + usize::from(stored.is_complete()))
                .recorded_by(&mut recorder);
            let elapsed = Elapsed::of(&journal, &stored, snapshot.as_ref());
            let launch = Launch {
                source,
                task,
                limits,
                stop: stop.clone(),
                warnings,
                queue: operator.queue().cloned(),
            };
            let running = RunningActions::of(&stored, snapshot.as_ref());
            let elapsed = Box::new(move || elapsed.until(WallTime::now()));
            let since = (now.unwrap_or_default(), elapsed as _);
            let world = ResumedWorld {
                journal: ReplayWorld::new(&stored, task),
                left: stored.lines.iter().filter(|line| is_answer(line)).count(),
                replay: Arc::clone(&replay),
                world: RestartableWorld::resumed(launch, running, since, beliefs),
                status: operator.status().cloned(),
            };
            let world = JournaledWorld::new(world, health.clone());
            let mut world = decorators
                .world(world, &Rational::ONE)
                .with_running(running_actions::open(snapshot.as_ref()))
                .live_when(|| replay.is_over());
            let mut watcher = ReplayWatcher {
                inner: watcher,
                replay: Arc::clone(&replay),
                health,
            };
            let outcome = execute(inputs, execution, &mut world, &mut watcher);
            world.into_inner().into_inner().world.stop();
            outcome?
        };
        if let Some(line) = replay.difference() {
            return Err(RunError::Failed(deviation_error(&name, line)));
        }
        Ok(JournaledOutcome {
            outcome,
            journal_failure: file.failure(),
        })
    }
}

/// Advice for an intact journal that cannot be interpreted.
const OTHER_VERSION: &str = "another version of this program may have written it: resume with that version, or start a \
                             new run with another journal";

/// Error of a journal that another version has written.
fn other_version_error(name: &str, error: &dyn fmt::Display) -> Error {
    unreadable_journal_error(name, &error.to_string(), OTHER_VERSION)
}

/// Returns the error for a journal that cannot be resumed.
fn unreadable_journal_error(name: &str, message: &str, advice: &str) -> Error {
    Error::new(format!("the journal {name}: {message}"), advice)
}

/// Returns the error for a replay that deviates from the journal.
fn deviation_error(name: &str, line: usize) -> Error {
    Error::new(
        format!(
            "the replay of the journal {name} makes other decisions from line {line} on; the world has received \
             nothing"
        ),
        OTHER_VERSION,
    )
}

/// Verdict of a run whose world has failed.
const WORLD_FAILED: &str = "world-failed";

/// Verdicts of a run without a plan, which can be resumed. Earlier versions used the first for failed planners as
/// well.
const WITHOUT_PLAN: [&str; 2] = ["no-plan", "planner-failed"];

/// Returns the number of lines before the end of a run whose world has failed. Such a world may be replaced, or started
/// again.
fn end_by_world(lines: &[Line]) -> Option<usize> {
    let is_end = |line: &Line| match line {
        // The cancellations that follow are repeated.
        Line::WorldFailed(_) => true,
        Line::Over(report) => report.verdict == WORLD_FAILED,
        _ => false,
    };
    lines.iter().position(is_end)
}

/// Returns `true` for an answer of the world.
fn is_answer(line: &Line) -> bool {
    matches!(line, Line::Passed(_) | Line::Looked(_))
}

/// World that replays the journal, then connects to the world itself.
struct ResumedWorld<'a> {
    journal: ReplayWorld,
    /// Number of answers that the journal still has.
    left: usize,
    replay: Arc<JournalReplay>,
    world: RestartableWorld<'a>,
    /// Published status of the run.
    status: Option<Status>,
}

impl<'a> ResumedWorld<'a> {
    /// Returns the world behind the journal, unless the replay has deviated.
    fn world(&mut self) -> Result<&mut RestartableWorld<'a>, WorldError> {
        if self.replay.difference().is_some() {
            return Err(WorldError::new(
                "the replay of the journal makes other decisions",
            ));
        }
        if let Some(status) = self.status.take() {
            status.set_replayed(false);
        }
        Ok(&mut self.world)
    }
}

impl World for ResumedWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        if self.replay.has_last() {
            return Ok(());
        }
        self.world()?.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let Some(left) = self.left.checked_sub(1) else {
            return self.world()?.wait(until);
        };
        self.left = left;
        let passage = self.journal.wait(until)?;
        self.world.note_time(&passage.now);
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        let Some(left) = self.left.checked_sub(1) else {
            return self.world()?.look(facts, fluents);
        };
        self.left = left;
        self.journal.look(facts, fluents)
    }
}
