//! A world whose answers have what is asked of the run, too.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Event, Observation, Passage, World, WorldError};
use elbowroom::executive::Status;
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;

use super::Attendance;
use super::held::Held;
use crate::bell::{Bell, Ring};
use crate::interrupt::Interrupt;
use elbowroom_executive::clock::Clock;
use elbowroom_executive::request_queue::RequestQueue;

/// How often it is looked whether a plan is there, or ready, in a second on the wall clock.
const PER_SECOND: i64 = 50;

/// The time on the wall clock after which a wait looks for requests.
const GLANCE: Duration = Duration::from_millis(50);

/// Waits in pieces, so that whatever waits at the queue is reported with the time that it is then.
///
/// While nothing is under way, or a plan is made beside the run, the world's time passes no faster
/// than the wall clock's: there is nothing to wait for but people, and planners take time.
pub(crate) struct Attended<'a, W> {
    inner: W,
    queue: Option<RequestQueue>,
    /// Where people ask what time it is.
    status: Option<Status>,
    task: Arc<Task>,
    interrupt: Interrupt,
    /// Rings when a plan is there.
    bell: Bell,
    /// How many of the world's seconds pass in one of the wall clock's.
    factor: Rational,
    /// Whether the world is there, and not only what a journal has of it.
    is_live: Box<dyn Fn() -> bool + Send + 'a>,
    /// How much of the world's time passes in a piece.
    piece: Rational,
    now: Rational,
    /// How far it is held back while a plan is made.
    held: Held,
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
            queue: attendance.queue().cloned(),
            status: attendance.status().cloned(),
            task: Arc::clone(task),
            interrupt: interrupt.clone(),
            bell: Bell::default(),
            factor: factor.clone(),
            is_live: Box::new(|| true),
            piece: Rational::new(millis, 1000) * factor,
            now: Rational::ZERO,
            held: Held::start(),
            open: BTreeSet::new(),
        }
    }

    /// The same, which reports when a plan is there.
    pub(crate) fn ringing(self, bell: &Bell) -> Self {
        let bell = bell.clone();
        Self { bell, ..self }
    }

    /// The same, of a run in which these are under way.
    pub(crate) fn under_way(self, open: impl IntoIterator<Item = u64>) -> Self {
        let open = open.into_iter().collect();
        Self { open, ..self }
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

    fn observed(&self, ring: Ring) -> Observation {
        let event = match ring {
            Ring::PlanMade => Event::PlanMade,
            Ring::PlanReady => Event::PlanReady,
        };
        let time = self.now.clone();
        Observation { time, event }
    }

    /// Asks the world itself.
    fn ask<T>(&mut self, question: impl FnOnce(&mut W) -> T) -> T {
        if let Some(queue) = &self.queue {
            queue.note_question();
        }
        let answer = question(&mut self.inner);
        if let Some(queue) = &self.queue {
            queue.note_answer();
        }
        answer
    }

    fn note(&mut self, passage: &Passage) {
        self.now.clone_from(&passage.now);
        if let Some(status) = &self.status {
            status.pass(&self.now);
        }
        for observation in &passage.observations {
            if let Event::Ended { ticket, .. } = &observation.event {
                self.open.remove(&ticket.0);
            }
        }
    }
}

impl<W: World> World for Attended<'_, W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.now = std::mem::take(&mut self.now).max(now.clone());
        if let Command::Start {
            ticket,
            duration: Some(_),
            ..
        } = command
        {
            self.open.insert(ticket.0);
        }
        self.ask(|world| world.command(now, command))
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        if self.queue.is_none() && !self.bell.is_awaited() {
            let passage = self.inner.wait(until)?;
            self.note(&passage);
            return Ok(passage);
        }
        if !(self.is_live)() {
            let passage = self.inner.wait(until)?;
            self.note(&passage);
            return Ok(passage);
        }
        if let Some(ring) = self.bell.heard_soon() {
            return Ok(Passage {
                now: self.now.clone(),
                observations: vec![self.observed(ring)],
            });
        }
        loop {
            let clock = Clock::start();
            let is_planning = self.bell.is_awaited();
            let piece = if is_planning {
                &self.factor * &Rational::new(1, PER_SECOND)
            } else {
                self.piece.clone()
            };
            let piece = &self.now + piece;
            let before = self.now.clone();
            let mut passage = self.ask(|world| world.wait(until.min(&piece)))?;
            let has_passed = passage.now > self.now;
            self.note(&passage);
            if is_planning {
                let passed = (&self.now - &before).to_f64() / self.factor.to_f64();
                let passed = Duration::try_from_secs_f64(passed).unwrap_or_default();
                self.bell.wait(self.held.after(passed));
            } else {
                self.held = Held::start();
            }
            if let Some(queue) = self.queue.as_ref().filter(|queue| !queue.is_empty()) {
                let mut asked = queue.drain(&self.now, &self.task);
                passage.observations.append(&mut asked);
            }
            if let Some(ring) = self.bell.heard() {
                passage.observations.push(self.observed(ring));
            }
            // Whether a clock that stands still is broken, the run decides.
            let is_over = !passage.observations.is_empty() || passage.now >= *until || !has_passed;
            if is_over || self.interrupt.is_requested() {
                return Ok(passage);
            }
            if self.open.is_empty() && !is_planning {
                std::thread::sleep(GLANCE.saturating_sub(clock.elapsed()));
            }
        }
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.ask(|world| world.look(facts, fluents))
    }
}
