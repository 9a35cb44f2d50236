//! World decorator that adds operators' requests and completed background tasks to each answer.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Event, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;

use super::OperatorInterface;
use super::throttle::SimulationThrottle;
use crate::clock::Clock;
use crate::completion_signal::{Completion, CompletionSignal};
use crate::interface::Status;
use crate::request_queue::RequestQueue;

/// Number of polls for a completed background task per second.
const POLLS_PER_SECOND: i64 = 50;

/// Wall-clock time between two polls for requests.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// World that waits in short steps and reports pending requests after each step.
///
/// While no action is running, or while a plan is made in the background, the world's time passes
/// no faster than the wall clock.
pub struct InteractiveWorld<'a, W> {
    inner: W,
    queue: Option<RequestQueue>,
    /// Published status, for its time.
    status: Option<Status>,
    task: Arc<Task>,
    stop: Stop,
    /// Completion signal of background tasks.
    signal: CompletionSignal,
    /// Seconds of the world per second of the wall clock.
    factor: Rational,
    /// Returns `false` while a journal is replayed.
    is_live: Box<dyn Fn() -> bool + Send + 'a>,
    /// Time of the world in one step.
    step: Rational,
    now: Rational,
    /// Delays a simulation while a plan is made.
    throttle: SimulationThrottle,
    /// Tickets of durative actions that have not ended.
    open: BTreeSet<u64>,
}

impl<'a, W: World> InteractiveWorld<'a, W> {
    /// Wraps a world. `factor` is the number of the world's seconds per second of the wall clock. `signal` is that of
    /// the run's background tasks.
    pub fn new(
        inner: W,
        operator: &OperatorInterface,
        task: &Arc<Task>,
        stop: &Stop,
        signal: &CompletionSignal,
        factor: &Rational,
    ) -> Self {
        let millis = i64::try_from(POLL_INTERVAL.as_millis()).unwrap_or(i64::MAX);
        Self {
            inner,
            queue: operator.queue().cloned(),
            status: operator.status().cloned(),
            task: Arc::clone(task),
            stop: stop.clone(),
            signal: signal.clone(),
            factor: factor.clone(),
            is_live: Box::new(|| true),
            step: Rational::new(millis, 1000) * factor,
            now: Rational::ZERO,
            throttle: SimulationThrottle::start(),
            open: BTreeSet::new(),
        }
    }

    /// Sets the tickets of actions that run at the start of a resumed run.
    #[must_use]
    pub fn with_running(self, open: impl IntoIterator<Item = u64>) -> Self {
        let open = open.into_iter().collect();
        Self { open, ..self }
    }

    /// Accepts no requests until `is_live` returns `true`.
    #[must_use]
    pub fn live_when(self, is_live: impl Fn() -> bool + Send + 'a) -> Self {
        let is_live = Box::new(is_live);
        Self { is_live, ..self }
    }

    /// Returns the wrapped world.
    pub fn into_inner(self) -> W {
        self.inner
    }

    fn observed(&self, completion: Completion) -> Observation {
        let event = match completion {
            Completion::PlanMade => Event::PlanMade,
            Completion::PlanReady => Event::PlanReady,
        };
        let time = self.now.clone();
        Observation { time, event }
    }

    /// Asks the wrapped world.
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

    fn note(&mut self, passage: &TimeAdvance) {
        self.now.clone_from(&passage.now);
        if let Some(status) = &self.status {
            status.set_time(&self.now);
        }
        for observation in &passage.observations {
            if let Event::Ended { ticket, .. } = &observation.event {
                self.open.remove(&ticket.0);
            }
        }
    }
}

impl<W: World> World for InteractiveWorld<'_, W> {
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

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        if self.queue.is_none() && !self.signal.is_awaited() {
            let passage = self.inner.wait(until)?;
            self.note(&passage);
            return Ok(passage);
        }
        if !(self.is_live)() {
            let passage = self.inner.wait(until)?;
            self.note(&passage);
            return Ok(passage);
        }
        if let Some(completion) = self.signal.poll_timeout() {
            return Ok(TimeAdvance {
                now: self.now.clone(),
                observations: vec![self.observed(completion)],
            });
        }
        loop {
            let clock = Clock::start();
            let is_planning = self.signal.is_awaited();
            let step = if is_planning {
                &self.factor * &Rational::new(1, POLLS_PER_SECOND)
            } else {
                self.step.clone()
            };
            let step = &self.now + step;
            let before = self.now.clone();
            let mut passage = self.ask(|world| world.wait(until.min(&step)))?;
            let has_passed = passage.now > self.now;
            self.note(&passage);
            if is_planning {
                let passed = (&self.now - &before).to_f64() / self.factor.to_f64();
                let passed = Duration::try_from_secs_f64(passed).unwrap_or_default();
                self.signal.wait(self.throttle.delay_after(passed));
            } else {
                self.throttle = SimulationThrottle::start();
            }
            if let Some(queue) = self.queue.as_ref().filter(|queue| !queue.is_empty()) {
                let mut asked = queue.drain(&self.now, &self.task);
                passage.observations.append(&mut asked);
            }
            if let Some(completion) = self.signal.poll() {
                passage.observations.push(self.observed(completion));
            }
            // The run decides whether a clock that does not advance is an error.
            let is_over = !passage.observations.is_empty() || passage.now >= *until || !has_passed;
            if is_over || self.stop.is_requested() {
                return Ok(passage);
            }
            if self.open.is_empty() && !is_planning {
                std::thread::sleep(POLL_INTERVAL.saturating_sub(clock.elapsed()));
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
