//! `elbowroom run --resume`: goes on with a run whose program has died.
//!
//! Everything that a run decides follows from what the world reported and what the planner
//! answered, and both stand in the journal. So the run is played again up to where its journal
//! ends, without a word to the world; there the world itself takes over. `docs/formats/journal.md`
//! has the rules for what was under way.

mod elapsed;
mod past;
mod under_way;

use std::fmt;
use std::path::Path;
use std::sync::Arc;

use elbowroom::answers::RunRequest;
use elbowroom::answers::run::run as execute;
use elbowroom::execute::RunSpec;
use elbowroom::execution::{
    Command, Ending, Event, Observation, Passage, Ticket, World, WorldError,
};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Line, ReplayWorld, Stored};

use super::shown::Views;
use super::spec::contradiction;
use crate::args::RunArgs;
use crate::exit::{Answer, Failure};
use crate::input;
use crate::interrupt::Interrupt;
use crate::output::{self, Output};
use crate::stopwatch::Stopwatch;
use elapsed::Elapsed;
use elbowroom_executive::background_planner::BackgroundPlanner;
use elbowroom_executive::background_preparer::BackgroundPreparer;
use elbowroom_executive::belief_updates::BeliefUpdates;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::journal::{Journal, JournalFile, Segments, WallTime};
use elbowroom_executive::journaling::{JournalHealth, JournalWriter, JournaledWorld};
use elbowroom_executive::operator::{InteractiveWorld, OperatorInterface};
use elbowroom_executive::process_world::{ProcessLimits, ProcessWorld};
use past::{Past, PastPlanner, PastRecorder, Watch};
use under_way::UnderWay;

/// A run that was cut off.
struct Cut {
    journal: Journal,
    /// The bytes of its file, at the beginning.
    length: u64,
    stored: Stored,
    spec: RunSpec,
}

/// Reads the journal of a run that can be gone on with.
fn cut(path: &Path) -> Result<Cut, Failure> {
    let name = path.display().to_string();
    // Who opens a named pipe may wait for ever for somebody to write.
    if std::fs::metadata(path).is_ok_and(|it| !it.is_file()) {
        return Err(Failure::new(
            format!("{name} is no file"),
            "name the file that --journal has written",
        ));
    }
    let length = std::fs::metadata(path).map_or(0, |it| it.len());
    let text = input::source(path, "journal")?;
    if !elbowroom_executive::journal::is_journal(text.text()) {
        return Err(Failure::new(
            format!("{name} is no journal of a run"),
            "`elbowroom run --journal` writes them; a trace can be played back with --replay",
        ));
    }
    let mut journal = Journal::read(text.text())
        .map_err(|why| unreadable(&name, &why, elbowroom_executive::journal::DAMAGE_ADVICE))?;
    if journal.text.is_empty() {
        let is_cut_off = !text.text().contains('\n');
        let (why, advice) = if is_cut_off {
            let why =
                "it ends before its first record does, so that nothing was ever told to the world";
            (why, "remove it, and begin the run again")
        } else {
            (
                "its first record is damaged",
                elbowroom_executive::journal::DAMAGE_ADVICE,
            )
        };
        return Err(unreadable(&name, why, advice));
    }
    let read = |journal: &Journal| {
        let stored = Stored::read(&journal.text);
        stored.map_err(|error| unreadable(&name, &error.to_string(), OTHER_VERSION))
    };
    let mut stored = read(&journal)?;
    // A world that has died may be there again.
    if let Some(Line::Over(report)) = stored.lines.last()
        && report.verdict == WORLD_FAILED
    {
        journal = journal.without_last();
        stored = read(&journal)?;
    }
    if let Some(Line::Over(report)) = stored.lines.last()
        && !WITHOUT_PLAN.contains(&report.verdict.as_str())
    {
        return Err(Failure::new(
            format!("the run of {name} is over: {}", report.verdict),
            "there is nothing to go on with; `elbowroom report` shows what was done",
        ));
    }
    let spec = stored.header();
    let spec: RunSpec =
        spec.map_err(|error| Failure::new(format!("{name}, {error}"), OTHER_VERSION))?;
    Ok(Cut {
        journal,
        length,
        stored,
        spec,
    })
}

/// What to do about a journal that is whole and is not understood.
const OTHER_VERSION: &str = "it may be of another version of this program: go on with that one, or begin a new \
                             run with another journal";

fn unreadable(name: &str, message: &str, advice: &str) -> Failure {
    Failure::new(format!("the journal {name}: {message}"), advice)
}

fn leads_elsewhere(name: &str, line: usize) -> Failure {
    Failure::new(
        format!(
            "the journal {name} does not lead to the same decisions, from line {line} on; nothing was \
             told to the world"
        ),
        OTHER_VERSION,
    )
}

/// Who wants to attend a run that goes on.
pub(in crate::commands) trait Host {
    /// Attends a run of this specification.
    ///
    /// # Errors
    /// When it is not one of those that this host attends.
    fn attend(
        &self,
        spec: &RunSpec,
        task: &Arc<Task>,
        interrupt: &Interrupt,
    ) -> Result<OperatorInterface, Failure>;

    /// When the journal is begun anew, if it is to be.
    fn segments(&self) -> Option<Segments> {
        None
    }
}

/// Nobody.
pub(in crate::commands) struct Alone<'a>(pub(in crate::commands) &'a RunArgs);

impl Host for Alone<'_> {
    fn attend(
        &self,
        spec: &RunSpec,
        _: &Arc<Task>,
        _: &Interrupt,
    ) -> Result<OperatorInterface, Failure> {
        if spec.is_lasting {
            return Err(Failure::new(
                "this is the journal of an executive that takes requests",
                "go on with `elbowroom serve --resume`",
            ));
        }
        if spec.is_attended && self.0.control.is_none() {
            return Err(Failure::new(
                "this run can be paused from its page, and may be",
                "give --serve and --control again",
            ));
        }
        Ok(if spec.is_attended {
            super::operator(self.0)
        } else {
            OperatorInterface::default()
        })
    }
}

/// Goes on with the run of a journal.
pub(in crate::commands) fn run(
    path: &Path,
    arguments: &RunArgs,
    host: &dyn Host,
    output: &mut Output,
) -> Answer {
    let name = path.display().to_string();
    let Cut {
        journal,
        length,
        stored,
        mut spec,
    } = cut(path)?;
    spec.threads = super::spec::threads_of(arguments, &spec.planner)?;
    let Some(command) = spec.world_process.clone() else {
        return Err(unreadable(&name, "its world was no process", OTHER_VERSION));
    };
    let task = Arc::new(super::task(&spec, output)?);
    // Before anything else is mentioned: the table of facts is as it was.
    let wrong = |error: &dyn fmt::Display| unreadable(&name, &error.to_string(), OTHER_VERSION);
    let snapshot = stored.snapshot().map_err(|error| wrong(&error))?;
    let stand = snapshot.as_ref().map(|it| it.stand(&task)).transpose();
    let stand = stand.map_err(|why| unreadable(&name, &format!("line 2: {why}"), OTHER_VERSION))?;
    let now = snapshot.as_ref().map(|it| it.now().clone());
    let first = spec.has_plan.then(|| stored.first_plan(&task));
    let first = first.transpose().map_err(|error| wrong(&error))?.flatten();
    let mut file = JournalFile::reopen(path, &journal, length)?
        .with_rotation(host.segments(), &output::warnings());
    let interrupt = Interrupt::listen_with_world();
    let operator = host.attend(&spec, &task, &interrupt)?;
    let background = super::background(arguments, &interrupt);
    if let Some(snapshot) = &snapshot {
        operator.begin_at(snapshot);
    }
    let health = JournalHealth::default();
    let beliefs = BeliefUpdates::default();
    let past = Arc::new(Past::new(&stored));
    let views = Views::open(arguments, &spec, &task, &interrupt, &operator)?;
    let outcome = {
        let recorder = PastRecorder {
            past: Arc::clone(&past),
            task: Arc::clone(&task),
            writer: JournalWriter::new(&task, &mut file, &health, operator.queue()),
        };
        let begun = Clock::start();
        let clock = || begun.seconds();
        let goes_on = || !interrupt.is_requested();
        let planner = spec
            .planner_for(&task, None, &clock, &goes_on)
            .map_err(contradiction)?;
        let request = RunRequest::new(&spec, &task)
            .beginning_with(first)
            .standing(stand)
            .reopened(stored.reopened() + usize::from(stored.is_complete()))
            .planned_by(PastPlanner::new(
                &stored,
                Box::new(BackgroundPlanner::new(planner, &spec, &background)),
            ))
            .prepared_by(
                BackgroundPreparer::new(&spec, &task, &background.signal).map_err(contradiction)?,
            )
            .told_to(super::both(operator.listener(), beliefs.listener()))
            .recorded_by(views.shown(operator.publishing(recorder, &task, true), &task));
        let world = JournaledWorld::new(
            PastWorld {
                replay: ReplayWorld::new(&stored, &task),
                left: stored.lines.iter().filter(|line| is_answer(line)).count(),
                past: Arc::clone(&past),
                under_way: UnderWay::of(&stored, snapshot.as_ref()),
                elapsed: Elapsed::of(&journal, &stored, snapshot.as_ref()),
                launch: Launch {
                    command,
                    task: &task,
                    patience: arguments.answer_within.clone(),
                    is_strict: arguments.strict_world,
                    interrupt: interrupt.clone(),
                },
                present: None,
                beliefs,
                last: now.unwrap_or_default(),
                shift: Rational::ZERO,
                news: None,
            },
            health.clone(),
        );
        let mut world = InteractiveWorld::new(
            world,
            &operator,
            &task,
            interrupt.stop(),
            &background.signal,
            &Rational::ONE,
        )
        .with_running(under_way::open(snapshot.as_ref()))
        .live_when(|| past.is_over());
        let mut watch = Watch {
            inner: Stopwatch::start(&interrupt),
            past: Arc::clone(&past),
            health: health.clone(),
        };
        let outcome = execute(request, &mut world, &mut watch);
        if let Some(world) = world.into_inner().into_inner().present {
            world.stop();
        }
        views.close();
        outcome.map_err(contradiction)?
    };
    if let Some(line) = past.difference() {
        return Err(leads_elsewhere(&name, line));
    }
    super::conclude((arguments, &spec), outcome, file.failure(), output)
}

/// The verdict of a run whose world has died.
const WORLD_FAILED: &str = "world-failed";

/// The verdicts of a run for which no plan was found, which is not to say that there is none. Before
/// the second was told apart, planners that failed ended in the first.
const WITHOUT_PLAN: [&str; 2] = ["no-plan", "planner-failed"];

/// Whether it is an answer of the world.
fn is_answer(line: &Line) -> bool {
    matches!(line, Line::Passed(_) | Line::Looked(_))
}

/// How the world is started again.
struct Launch<'a> {
    command: String,
    task: &'a Arc<Task>,
    patience: Rational,
    is_strict: bool,
    interrupt: Interrupt,
}

/// The world of the journal, and behind its end the world itself.
struct PastWorld<'a> {
    replay: ReplayWorld,
    /// How many answers of the world the journal still has.
    left: usize,
    past: Arc<Past>,
    under_way: UnderWay,
    /// The time since the journal ends.
    elapsed: Elapsed,
    launch: Launch<'a>,
    present: Option<ProcessWorld>,
    /// What it is told of what the run believes.
    beliefs: BeliefUpdates,
    /// What time it is, for the run.
    last: Rational,
    /// What is added to the times of a world that begins anew.
    shift: Rational,
    /// What became of what was under way, until the run has heard it.
    news: Option<Vec<Observation>>,
}

impl PastWorld<'_> {
    /// The world itself, started again if need be. Then it is asked what became of what was under
    /// way.
    fn present(&mut self) -> Result<&mut ProcessWorld, WorldError> {
        if self.past.difference().is_some() {
            return Err(WorldError::new("the journal leads to other decisions"));
        }
        if self.present.is_none() {
            let launch = &self.launch;
            let limits = ProcessLimits {
                answer_timeout: launch.patience.clone(),
                is_strict: launch.is_strict,
            };
            let resumed = self.under_way.told(&self.last);
            let world = ProcessWorld::resume(
                &launch.command,
                launch.task,
                limits,
                launch.interrupt.stop().clone(),
                (&resumed, self.under_way.given),
            );
            let world = world.map_err(|failure| WorldError::new(failure.message()))?;
            self.present = Some(world.with_beliefs(self.beliefs.clone()));
            self.reconcile()?;
        }
        self.present
            .as_mut()
            .ok_or_else(|| WorldError::new("the world is not there"))
    }

    /// Asks what became of what was under way, and tells what was told already again.
    fn reconcile(&mut self) -> Result<(), WorldError> {
        let Some(world) = &mut self.present else {
            return Ok(());
        };
        let tickets: Vec<u64> = self.under_way.open.keys().copied().collect();
        let (passage, knows) = world.recall(&tickets)?;
        if !knows {
            // The clock of the world restarts at 0. That of the run has advanced with the wall clock, except for simulations.
            self.shift = match self.elapsed.until(WallTime::now()) {
                Ok(elapsed) => &self.last + elapsed - &passage.now,
                Err(why) => {
                    output::warn(&format!(
                        "the run resumes at {} s, the time of the last record of its journal: {why}",
                        self.last.to_decimal(3)
                    ));
                    self.last.clone()
                }
            };
        }
        self.last = (&passage.now + &self.shift).max(self.last.clone());
        let mut news = shifted(passage.observations, &self.shift);
        for (ticket, open) in &self.under_way.open {
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
            // Whether the world has heard it is not known, and it may be told twice. What it knows
            // nothing of may go on all the same, and is to stop.
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

impl World for PastWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        if self.past.has_last() {
            return Ok(());
        }
        self.present()?;
        let told = (now - &self.shift).max(Rational::ZERO);
        if self.news.is_none() {
            return self.present()?.command(&told, command);
        }
        // It was decided before anybody knew what became of the rest.
        match command {
            Command::Cancel { .. } => self.present()?.command(&told, command),
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
            let passage = self.replay.wait(until)?;
            self.last = passage.now.clone().max(self.last.clone());
            return Ok(passage);
        }
        self.present()?;
        if let Some(observations) = self.news.take() {
            let now = self.last.clone();
            return Ok(Passage { now, observations });
        }
        let shift = self.shift.clone();
        let passage = self.present()?.wait(&(until - &shift))?;
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
            return self.replay.look(facts, fluents);
        }
        let mut seen = shifted(self.present()?.look(facts, fluents)?, &self.shift.clone());
        if let Some(mut news) = self.news.take() {
            news.append(&mut seen);
            return Ok(news);
        }
        Ok(seen)
    }
}
