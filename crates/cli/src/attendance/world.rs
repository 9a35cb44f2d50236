//! A world whose answers have what is asked of the run, too.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Event, Observation, Passage, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;

use super::Attendance;
use crate::clock::Clock;
use crate::desk::Desk;
use crate::interrupt::Interrupt;

/// The time on the wall clock after which a wait looks for requests.
const GLANCE: Duration = Duration::from_millis(50);

/// Waits in pieces, so that whatever waits at the desk is reported with the time that it is then.
///
/// While nothing is under way, the world's time passes no faster than the wall clock's: there is
/// nothing to wait for but people.
pub(crate) struct Attended<'a, W> {
    inner: W,
    desk: Option<Desk>,
    task: Arc<Task>,
    interrupt: Interrupt,
    /// Whether the world is there, and not only what a journal has of it.
    is_live: Box<dyn Fn() -> bool + Send + 'a>,
    /// How much of the world's time passes in a piece.
    piece: Rational,
    now: Rational,
    /// What was told to start and has not ended.
    open: BTreeSet<u64>,
}

impl<'a, W: World> Attended<'a, W> {
    /// `factor` is how many of the world's seconds pass in one of the wall clock's.
    pub(crate) fn new(
        inner: W,
        attendance: &Attendance,
        task: &Arc<Task>,
        interrupt: &Interrupt,
        factor: &Rational,
    ) -> Self {
        let millis = i64::try_from(GLANCE.as_millis()).unwrap_or(i64::MAX);
        Self {
            inner,
            desk: attendance.desk().cloned(),
            task: Arc::clone(task),
            interrupt: interrupt.clone(),
            is_live: Box::new(|| true),
            piece: Rational::new(millis, 1000) * factor,
            now: Rational::ZERO,
            open: BTreeSet::new(),
        }
    }

    /// The same, which takes no requests before that.
    pub(crate) fn once(self, is_live: impl Fn() -> bool + Send + 'a) -> Self {
        let is_live = Box::new(is_live);
        Self { is_live, ..self }
    }

    /// The world itself.
    pub(crate) fn into_inner(self) -> W {
        self.inner
    }

    fn note(&mut self, passage: &Passage) {
        self.now.clone_from(&passage.now);
        for observation in &passage.observations {
            if let Event::Ended { ticket, .. } = &observation.event {
                self.open.remove(&ticket.0);
            }
        }
    }
}

impl<W: World> World for Attended<'_, W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        if let Command::Start {
            ticket,
            duration: Some(_),
            ..
        } = command
        {
            self.open.insert(ticket.0);
        }
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        let Some(desk) = self.desk.clone() else {
            return self.inner.wait(until);
        };
        if !(self.is_live)() {
            let passage = self.inner.wait(until)?;
            self.note(&passage);
            return Ok(passage);
        }
        loop {
            let clock = Clock::start();
            let piece = &self.now + &self.piece;
            let mut passage = self.inner.wait(until.min(&piece))?;
            let has_passed = passage.now > self.now;
            self.note(&passage);
            if !desk.is_empty() {
                let mut asked = desk.fetch(&self.now, &self.task);
                passage.observations.append(&mut asked);
            }
            // Whether a clock that stands still is broken, the run decides.
            let is_over = !passage.observations.is_empty() || passage.now >= *until || !has_passed;
            if is_over || self.interrupt.is_requested() {
                return Ok(passage);
            }
            if self.open.is_empty() {
                std::thread::sleep(GLANCE.saturating_sub(clock.elapsed()));
            }
        }
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}
