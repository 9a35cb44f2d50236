//! World that can be connected again: when a run is resumed from its journal, and when the world's
//! program ends during the run.
//!
//! After a reconnection, the run requests the outcomes of the actions that were running. Actions
//! that the world does not know have failed.

use std::time::Duration;

use elbowroom::execution::{
    ActionHandle, Command, Ending, Event, Observation, TimeAdvance, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;

use crate::belief_updates::BeliefUpdates;
use crate::clock::Clock;
use crate::error::Error;
use crate::running_actions::RunningActions;
use crate::world_connection::{Launch, WorldConnection, WorldSource};

/// Delay before the first restart. Each further one in a row takes twice as long.
const INITIAL_DELAY: Duration = Duration::from_millis(500);

/// Longest delay before a restart.
const MAX_DELAY: Duration = Duration::from_secs(30);

/// Time without a failure after which the count of restarts returns to 0.
const RELIABLE_AFTER: Duration = Duration::from_secs(600);

/// Interval between two checks for a request to stop the run.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Computes the world's time since the last record, or returns the reason why it is unknown.
pub(crate) type Elapsed<'a> = Box<dyn Fn() -> Result<Rational, &'static str> + Send + 'a>;

/// World decorator that connects its world when it is needed; see the module.
pub(crate) struct RestartableWorld<'a> {
    launch: Launch<'a>,
    world: Option<WorldConnection<'a>>,
    running: RunningActions,
    beliefs: BeliefUpdates,
    /// Time since the end of the journal, until the world of a resumed run is connected.
    elapsed: Option<Elapsed<'a>>,
    /// Runs since the world has reported its time.
    answered: Clock,
    /// Current time of the run.
    last: Rational,
    /// Offset that is added to the times of a world that restarts at time 0.
    shift: Rational,
    /// Outcome of the actions that were running, until the run has received it.
    news: Option<Vec<Observation>>,
    /// Number of restarts since the program last ran without failure for long enough, and the time
    /// of its start.
    restarts: u32,
    started: Clock,
}

impl<'a> RestartableWorld<'a> {
    /// Connects the world of a new run.
    ///
    /// # Errors
    /// When its program cannot be started.
    pub(crate) fn start(mut launch: Launch<'a>, beliefs: BeliefUpdates) -> Result<Self, Error> {
        let connection = WorldConnection::start(&mut launch, &beliefs)?;
        let running = RunningActions::default();
        let mut world = Self::unconnected(launch, running, Rational::ZERO, beliefs);
        world.world = Some(connection);
        Ok(world)
    }

    /// Connects the world of a resumed run when it is needed first. These actions were `running` at the end of the
    /// journal, at the time `last`.
    pub(crate) fn resumed(
        launch: Launch<'a>,
        running: RunningActions,
        (last, elapsed): (Rational, Elapsed<'a>),
        beliefs: BeliefUpdates,
    ) -> Self {
        Self {
            elapsed: Some(elapsed),
            ..Self::unconnected(launch, running, last, beliefs)
        }
    }

    fn unconnected(
        launch: Launch<'a>,
        running: RunningActions,
        last: Rational,
        beliefs: BeliefUpdates,
    ) -> Self {
        Self {
            launch,
            world: None,
            running,
            beliefs,
            elapsed: None,
            answered: Clock::start(),
            last,
            shift: Rational::ZERO,
            news: None,
            restarts: 0,
            started: Clock::start(),
        }
    }

    /// Records that the run has reached this time, while its journal is replayed.
    pub(crate) fn note_time(&mut self, now: &Rational) {
        if *now > self.last {
            self.last.clone_from(now);
        }
    }

    /// Stops the program, if it runs.
    pub(crate) fn stop(self) {
        if let Some(world) = self.world {
            world.stop();
        }
    }

    /// Returns the world. Connects it if it is not connected, and requests the outcome of running actions.
    fn world(&mut self) -> Result<&mut WorldConnection<'a>, WorldError> {
        if self.world.is_none() {
            let (launch, last) = (&mut self.launch, &self.last);
            let world = WorldConnection::resume(launch, &self.beliefs, &self.running, last);
            self.world = Some(world.map_err(|error| WorldError::new(error.message()))?);
            self.started = Clock::start();
            self.reconcile()?;
        }
        let missing = || WorldError::new("the world is not running");
        self.world.as_mut().ok_or_else(missing)
    }

    /// Requests the outcome of running actions, and repeats cancellations.
    fn reconcile(&mut self) -> Result<(), WorldError> {
        let Some(world) = &mut self.world else {
            return Ok(());
        };
        let (passage, knows) = world.recall(&self.running, &self.last)?;
        let is_resumed = self.elapsed.is_some();
        if knows {
            self.shift = Rational::ZERO;
        } else {
            // The clock of the world restarts at 0. That of the run has advanced with the wall clock, except for
            // simulations.
            let elapsed = match self.elapsed.take() {
                Some(elapsed) => elapsed(),
                None => Ok(self.answered.seconds()),
            };
            self.shift = match elapsed {
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
        self.elapsed = None;
        self.last = (&passage.now + &self.shift).max(self.last.clone());
        let mut news = shifted(passage.observations, &self.shift);
        for (ticket, is_cancelled) in self.running.open() {
            let is_told = news.iter().any(|it| is_about(&it.event, ticket));
            if !(knows && is_told) {
                let why = match (knows, is_resumed) {
                    (true, _) => "the world does not know this action after the restart",
                    (false, true) => {
                        "it was running when the run was interrupted, and the world does not know its outcome"
                    }
                    (false, false) => {
                        "it was running when the world ended, and the world does not know its outcome"
                    }
                };
                news.push(failed(ActionHandle(ticket), &self.last, why));
            }
            // The world may have received the cancellation already. An action that it does not know may still run,
            // but not in a new object.
            if (is_cancelled || !is_told) && (knows || world.is_program()) {
                let ticket = ActionHandle(ticket);
                let told = (&self.last - &self.shift).max(Rational::ZERO);
                world.command(&told, &Command::Cancel { ticket })?;
            }
        }
        for observation in &news {
            self.running.observe(&observation.event);
        }
        self.news = Some(news);
        self.answered = Clock::start();
        Ok(())
    }

    /// Restarts a program after a failure, up to the limit on restarts. Returns the failure if the
    /// limit is reached.
    fn restart(&mut self, failure: WorldError) -> Result<(), WorldError> {
        let mut failure = failure;
        if self.started.elapsed() > RELIABLE_AFTER {
            self.restarts = 0;
        }
        if let WorldSource::Embedded(_) = self.launch.source {
            return Err(failure);
        }
        while self.restarts < self.launch.limits.restarts && !self.launch.stop.is_requested() {
            if let Some(world) = self.world.take() {
                world.stop();
            }
            let delay = INITIAL_DELAY.saturating_mul(1 << self.restarts.min(16));
            self.restarts += 1;
            let words = format!(
                "{}; the world is restarted (restart {} of {})",
                failure.message, self.restarts, self.launch.limits.restarts
            );
            self.launch.warnings.warn(&words);
            self.note_restart(Some(words));
            self.pause(delay.min(MAX_DELAY));
            let restarted = self.world().map(|_| ());
            self.note_restart(None);
            match restarted {
                Ok(()) => return Ok(()),
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    /// Reports a restart to operators, or its end.
    fn note_restart(&self, why: Option<String>) {
        if let Some(queue) = &self.launch.queue {
            queue.note_restart(why);
        }
    }

    /// Waits by the wall clock, unless the run is to stop.
    fn pause(&self, delay: Duration) {
        let clock = Clock::start();
        while !self.launch.stop.is_requested() {
            let left = delay.saturating_sub(clock.elapsed());
            if left.is_zero() {
                break;
            }
            std::thread::sleep(left.min(POLL_INTERVAL));
        }
    }

    /// Asks the world. Returns `None` if it was started again instead.
    fn ask<T>(
        &mut self,
        question: impl FnOnce(&mut WorldConnection<'a>) -> Result<T, WorldError>,
    ) -> Result<Option<T>, WorldError> {
        let answer = match self.world() {
            Ok(world) => question(world),
            Err(error) => Err(error),
        };
        match answer {
            Ok(answer) => Ok(Some(answer)),
            Err(failure) => self.restart(failure).map(|()| None),
        }
    }

    /// Returns the outcomes that became known at a restart, with the time.
    fn take_recalled(&mut self) -> Option<TimeAdvance> {
        let observations = self.news.take()?;
        let now = self.last.clone();
        Some(TimeAdvance { now, observations })
    }
}

fn is_about(event: &Event, about: u64) -> bool {
    match event {
        Event::Started { ticket, .. } | Event::Ended { ticket, .. } => ticket.0 == about,
        _ => false,
    }
}

fn failed(ticket: ActionHandle, time: &Rational, why: &str) -> Observation {
    Observation {
        time: time.clone(),
        event: Event::Ended {
            ticket,
            ending: Ending::Failed {
                why: why.to_owned(),
            },
            measured: Vec::new(),
        },
    }
}

fn shifted(mut observations: Vec<Observation>, shift: &Rational) -> Vec<Observation> {
    for observation in &mut observations {
        observation.time = &observation.time + shift;
    }
    observations
}

impl World for RestartableWorld<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        if self.world.is_none() {
            self.ask(|_| Ok(()))?;
        }
        if let (Some(news), Command::Start { ticket, .. }) = (&mut self.news, command) {
            // The decision was made before the outcome of running actions was known.
            let why = "it was not started: the world was being restarted";
            news.push(failed(*ticket, &self.last, why));
            return Ok(());
        }
        self.running.note(now, command);
        let told = (now - &self.shift).max(Rational::ZERO);
        self.ask(|world| world.command(&told, command)).map(drop)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        if self.world.is_none() {
            self.ask(|_| Ok(()))?;
        }
        if let Some(news) = self.take_recalled() {
            return Ok(news);
        }
        let local = until - &self.shift;
        let Some(passage) = self.ask(|world| world.wait(&local))? else {
            let now = self.last.clone();
            return Ok(self.take_recalled().unwrap_or(TimeAdvance {
                now,
                observations: Vec::new(),
            }));
        };
        let passage = TimeAdvance {
            now: &passage.now + &self.shift,
            observations: shifted(passage.observations, &self.shift),
        };
        self.note_time(&passage.now);
        self.answered = Clock::start();
        for observation in &passage.observations {
            self.running.observe(&observation.event);
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        // After a restart the question is repeated.
        let seen = loop {
            if let Some(seen) = self.ask(|world| world.look(facts, fluents))? {
                break seen;
            }
        };
        let mut news = self.news.take().unwrap_or_default();
        news.extend(shifted(seen, &self.shift));
        Ok(news)
    }
}
