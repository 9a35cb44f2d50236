//! A world on a wall clock.
//!
//! Its time 0 is the moment at which the first plan is ready and the executor has prepared for it; with
//! a calendar that begins now, the moment at which the calendar is read.
//! What is decided takes no time in the world, but making further plans does: as long as it takes on
//! the wall clock, times the factor. What happens meanwhile is reported afterwards, with the times
//! at which it happened.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use elbowroom::execution::run::PlanningTime;
use elbowroom::execution::{
    Command, Observation, Passage, Planner, PlannerAnswer, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// A simulated clock that runs `factor` times as fast as the wall clock.
pub(super) struct Pace {
    /// Since the world was first told or asked something.
    clock: OnceLock<Clock>,
    factor: Rational,
    /// The time for which the world's clock was stopped, on the wall clock.
    stopped: Mutex<Duration>,
}

impl Pace {
    /// The world's time passes with the clock `since`, if there is one; otherwise it is 0 until
    /// [`Pace::begin`].
    pub(super) fn new(factor: &Rational, since: Option<Clock>) -> Self {
        Self {
            clock: since.map_or_else(OnceLock::new, OnceLock::from),
            factor: factor.clone(),
            stopped: Mutex::new(Duration::ZERO),
        }
    }

    /// The world's time passes from now on, unless it did so before.
    fn begin(&self) {
        self.clock.get_or_init(Clock::start);
    }

    fn has_begun(&self) -> bool {
        self.clock.get().is_some()
    }

    /// How long the world's clock has been going, on the wall clock.
    fn passed(&self) -> Duration {
        let since = self.clock.get().map_or(Duration::ZERO, |it| it.elapsed());
        since.saturating_sub(self.stopped())
    }

    fn stopped(&self) -> Duration {
        *self.stopped.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The time until the world's clock reads `time`.
    fn left(&self, time: &Rational) -> Duration {
        on_the_wall(time, &self.factor).saturating_sub(self.passed())
    }

    /// The reading of the world's clock after this time on the wall clock, rounded to a thousandth
    /// of a second.
    fn after(&self, while_on_the_wall: Duration) -> Rational {
        let millis = (self.passed() + while_on_the_wall).as_millis();
        let seconds = Rational::new(i64::try_from(millis).unwrap_or(i64::MAX), 1000);
        seconds * &self.factor
    }

    /// `spent` is all that planning took on the wall clock; in the world it takes `allowed`. For
    /// what is longer, the world's clock was stopped. Before it goes there is nothing to stop.
    fn stop(&self, spent: Duration, allowed: &Rational) {
        if !self.has_begun() {
            return;
        }
        let excess = spent.saturating_sub(on_the_wall(allowed, &self.factor));
        *self.stopped.lock().unwrap_or_else(PoisonError::into_inner) += excess;
    }
}

/// How long the world's `time` is on the wall clock.
fn on_the_wall(time: &Rational, factor: &Rational) -> Duration {
    let seconds = time.to_f64() / factor.to_f64();
    if seconds > 0.0 {
        // More seconds than can be counted: nobody lives to see that.
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
    } else {
        Duration::ZERO
    }
}

/// Lets the time of another world pass at a pace.
pub(super) struct Realtime<'a> {
    pub(super) inner: &'a mut dyn World,
    pub(super) pace: &'a Pace,
    /// Ends a wait where it has come to.
    pub(super) interrupt: &'a Interrupt,
}

/// The interval at which a sleep checks for an interrupt.
const NAP: Duration = Duration::from_millis(50);

impl World for Realtime<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.pace.begin();
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
        self.pace.begin();
        loop {
            let soon = self.pace.after(NAP);
            let passage = self.inner.wait(until.min(&soon))?;
            std::thread::sleep(self.pace.left(&passage.now));
            let is_over = !passage.observations.is_empty() || passage.now >= *until;
            if is_over || self.interrupt.is_requested() {
                return Ok(passage);
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

/// A planner in such a world.
pub(super) struct PacedPlanner<'a> {
    pub(super) inner: Box<dyn Planner + 'a>,
    pub(super) pace: &'a Pace,
    /// The planning time, as it passes in the world.
    pub(super) planning_time: &'a PlanningTime,
}

impl Planner for PacedPlanner<'_> {
    fn expect(&mut self, task: &Task, situation: &Situation) {
        self.inner.expect(task, situation);
    }

    // The clock goes on while a plan is made aside.
    fn begin(&mut self, task: &Task, situation: &Situation) -> bool {
        self.inner.begin(task, situation)
    }

    fn collect(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        self.inner.collect(task, situation)
    }

    fn give_up(&mut self) {
        self.inner.give_up();
    }

    fn plan(&mut self, task: &Task, situation: &Situation) -> PlannerAnswer {
        let clock = Clock::start();
        let mut answer = self.inner.plan(task, situation);
        match self.planning_time {
            PlanningTime::Measured if self.pace.has_begun() => {
                answer.seconds = Some(clock.seconds() * &self.pace.factor);
            }
            PlanningTime::Measured => answer.seconds = Some(Rational::ZERO),
            PlanningTime::Seconds(seconds) => self.pace.stop(clock.elapsed(), seconds),
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::{Pace, on_the_wall};
    use elbowroom::num::Rational;
    use std::time::Duration;

    #[test]
    fn no_time_is_too_long_or_too_short_to_be_counted() {
        let tiny = Rational::new(1, 1_000_000_000_000) * Rational::new(1, 1_000_000_000_000);
        assert_eq!(on_the_wall(&Rational::ONE, &tiny), Duration::MAX);
        assert_eq!(on_the_wall(&Rational::from(-1), &tiny), Duration::ZERO);
        let ten = Rational::from(10);
        assert_eq!(
            on_the_wall(&Rational::from(5), &ten),
            Duration::from_millis(500)
        );
    }

    #[test]
    fn the_clock_stands_still_while_planning_takes_longer_than_it_may() {
        let pace = Pace::new(&Rational::from(10), None);
        pace.stop(Duration::from_secs(5), &Rational::ONE);
        assert_eq!(pace.stopped(), Duration::ZERO, "it does not go yet");
        pace.begin();
        // Two seconds of planning, of which the world sees three of its own, 0.3 on the wall.
        pace.stop(Duration::from_secs(2), &Rational::from(3));
        assert_eq!(pace.stopped(), Duration::from_millis(1700));
        pace.stop(Duration::from_millis(100), &Rational::from(3));
        assert_eq!(pace.stopped(), Duration::from_millis(1700));
    }
}
