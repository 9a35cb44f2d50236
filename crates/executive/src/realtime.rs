//! Simulated world on a wall clock.
//!
//! Time 0 is the moment at which the executor is prepared for the first plan, or at which a calendar that begins
//! now is read. Decisions take no time in the world. Planning takes its wall-clock time multiplied by the
//! factor. Events during planning are reported afterwards, with their times.

use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::Duration;

use elbowroom::execution::run::PlanningTime;
use elbowroom::execution::{
    Command, Observation, Planner, PlannerAnswer, TimeAdvance, World, WorldError,
};
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::model::{Situation, Task};
use elbowroom::num::Rational;
use elbowroom::num::work::Stop;

use crate::clock::Clock;

/// Simulated clock that runs `factor` times as fast as the wall clock.
pub struct ScaledClock {
    /// Runs since the first command or question to the world.
    clock: OnceLock<Clock>,
    factor: Rational,
    /// Wall-clock time for which the world's clock was stopped.
    stopped: Mutex<Duration>,
}

impl ScaledClock {
    /// Creates a clock that started with `since`, or starts with the first command or question to the world.
    pub fn new(factor: &Rational, since: Option<Clock>) -> Self {
        Self {
            clock: since.map_or_else(OnceLock::new, OnceLock::from),
            factor: factor.clone(),
            stopped: Mutex::new(Duration::ZERO),
        }
    }

    /// Starts the clock unless it runs already.
    fn begin(&self) {
        self.clock.get_or_init(Clock::start);
    }

    fn has_begun(&self) -> bool {
        self.clock.get().is_some()
    }

    /// Returns the wall-clock time for which the world's clock has run.
    fn passed(&self) -> Duration {
        let since = self.clock.get().map_or(Duration::ZERO, |it| it.elapsed());
        since.saturating_sub(self.stopped())
    }

    fn stopped(&self) -> Duration {
        *self.stopped.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the wall-clock time until the world's clock reads `time`.
    fn remaining_wall_time(&self, time: &Rational) -> Duration {
        to_wall_time(time, &self.factor).saturating_sub(self.passed())
    }

    /// Returns the reading of the world's clock after this wall-clock time, rounded down to a millisecond.
    fn time_after(&self, while_on_the_wall: Duration) -> Rational {
        let millis = (self.passed() + while_on_the_wall).as_millis();
        let seconds = Rational::new(i64::try_from(millis).unwrap_or(i64::MAX), 1000);
        seconds * &self.factor
    }

    /// Stops the world's clock for the part of the wall-clock time `spent` on planning that exceeds `allowed`, the
    /// planning time in the world. No effect before the clock runs.
    fn stop(&self, spent: Duration, allowed: &Rational) {
        if !self.has_begun() {
            return;
        }
        let excess = spent.saturating_sub(to_wall_time(allowed, &self.factor));
        *self.stopped.lock().unwrap_or_else(PoisonError::into_inner) += excess;
    }
}

/// Converts a time of the world to wall-clock time.
fn to_wall_time(time: &Rational, factor: &Rational) -> Duration {
    let seconds = time.to_f64() / factor.to_f64();
    if seconds > 0.0 {
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)
    } else {
        Duration::ZERO
    }
}

/// World decorator that lets time pass on a scaled wall clock.
pub struct Realtime<'a> {
    /// The simulated world.
    pub inner: &'a mut dyn World,
    /// Its clock.
    pub clock: &'a ScaledClock,
    /// Request that ends a pending wait.
    pub stop: &'a Stop,
}

/// Interval between two checks for a stop request.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

impl World for Realtime<'_> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        self.clock.begin();
        self.inner.command(now, command)
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        self.clock.begin();
        loop {
            let soon = self.clock.time_after(POLL_INTERVAL);
            let passage = self.inner.wait(until.min(&soon))?;
            std::thread::sleep(self.clock.remaining_wall_time(&passage.now));
            let is_over = !passage.observations.is_empty() || passage.now >= *until;
            if is_over || self.stop.is_requested() {
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

/// Planner decorator that measures or fixes the planning time in the world.
pub struct TimedPlanner<'a> {
    /// The planner.
    pub inner: Box<dyn Planner + 'a>,
    /// Clock of the world.
    pub clock: &'a ScaledClock,
    /// Planning time in the world.
    pub planning_time: &'a PlanningTime,
}

impl Planner for TimedPlanner<'_> {
    fn expect(&mut self, task: &Task, situation: &Situation) {
        self.inner.expect(task, situation);
    }

    // The clock runs while a plan is made in the background.
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
            PlanningTime::Measured if self.clock.has_begun() => {
                answer.seconds = Some(clock.seconds() * &self.clock.factor);
            }
            PlanningTime::Measured => answer.seconds = Some(Rational::ZERO),
            PlanningTime::Seconds(seconds) => self.clock.stop(clock.elapsed(), seconds),
        }
        answer
    }
}

#[cfg(test)]
mod tests {
    use super::{ScaledClock, to_wall_time};
    use elbowroom::num::Rational;
    use std::time::Duration;

    #[test]
    fn extreme_times_are_converted() {
        let tiny = Rational::new(1, 1_000_000_000_000) * Rational::new(1, 1_000_000_000_000);
        assert_eq!(to_wall_time(&Rational::ONE, &tiny), Duration::MAX);
        assert_eq!(to_wall_time(&Rational::from(-1), &tiny), Duration::ZERO);
        let ten = Rational::from(10);
        assert_eq!(
            to_wall_time(&Rational::from(5), &ten),
            Duration::from_millis(500)
        );
    }

    #[test]
    fn clock_stops_while_planning_exceeds_its_time() {
        let clock = ScaledClock::new(&Rational::from(10), None);
        clock.stop(Duration::from_secs(5), &Rational::ONE);
        assert_eq!(clock.stopped(), Duration::ZERO, "it does not run yet");
        clock.begin();
        // Two seconds of planning: three in the world, 0.3 on the wall clock.
        clock.stop(Duration::from_secs(2), &Rational::from(3));
        assert_eq!(clock.stopped(), Duration::from_millis(1700));
        clock.stop(Duration::from_millis(100), &Rational::from(3));
        assert_eq!(clock.stopped(), Duration::from_millis(1700));
    }
}
