//! A world on a wall clock.

use std::sync::Arc;
use std::time::Duration;

use elbowroom::execution::{Command, Observation, Passage, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;

use crate::clock::Clock;

/// Lets the time of another world pass at a fixed rate of the wall clock's.
pub(super) struct Realtime<'a> {
    inner: &'a mut dyn World,
    clock: Clock,
    factor: f64,
}

impl<'a> Realtime<'a> {
    /// `factor` seconds of the world pass in one second.
    pub(super) fn new(inner: &'a mut dyn World, factor: &Rational) -> Self {
        Self {
            inner,
            clock: Clock::start(),
            factor: factor.to_f64(),
        }
    }
}

impl World for Realtime<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        let passage = self.inner.wait(until)?;
        let due = passage.now.to_f64() / self.factor;
        let early = due - self.clock.elapsed().as_secs_f64();
        if let Ok(pause) = Duration::try_from_secs_f64(early) {
            std::thread::sleep(pause);
        }
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }

    fn know(&mut self, task: &Arc<Task>) {
        self.inner.know(task);
    }
}
