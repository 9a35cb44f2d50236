//! Limit on the speed of simulations while a plan is made in the background.

use std::time::Duration;

use crate::clock::Clock;

/// Limit on one delay.
const MAX_DELAY: Duration = Duration::from_millis(100);

/// Delays a simulation that runs ahead of the wall clock, but not a robot.
///
/// An answer without a delay before it distinguishes the two: for a robot, its time has passed on the wall clock.
/// After a delay they cannot be distinguished, so that such an answer is counted and causes no delay.
#[derive(Debug)]
pub(super) struct SimulationThrottle {
    /// Runs since the last answer.
    since: Clock,
    /// Lead of the world's clock over the wall clock.
    lead: Duration,
    /// `true` if there was a delay since the last answer.
    has_slept: bool,
}

impl SimulationThrottle {
    /// Creates a throttle for a world that is not ahead.
    pub(super) fn start() -> Self {
        Self {
            since: Clock::start(),
            lead: Duration::ZERO,
            has_slept: false,
        }
    }

    /// Records an answer. `passed` is the time of the world since the previous answer. Returns the delay before the
    /// next question.
    pub(super) fn delay_after(&mut self, passed: Duration) -> Duration {
        let elapsed = self.since.elapsed();
        self.since = Clock::start();
        self.pause(passed, elapsed)
    }

    fn pause(&mut self, passed: Duration, elapsed: Duration) -> Duration {
        let has_slept = std::mem::take(&mut self.has_slept);
        // The latency of answers varies.
        if !has_slept && passed <= elapsed + passed / 4 {
            self.lead = Duration::ZERO;
            return Duration::ZERO;
        }
        self.lead = (self.lead + passed).saturating_sub(elapsed).min(MAX_DELAY);
        if has_slept {
            return Duration::ZERO;
        }
        self.has_slept = !self.lead.is_zero();
        self.lead
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::SimulationThrottle;

    const PIECE: Duration = Duration::from_millis(20);

    #[test]
    fn simulation_is_as_slow_as_the_wall_clock() {
        let mut throttle = SimulationThrottle::start();
        let (mut passed, mut elapsed) = (Duration::ZERO, Duration::ZERO);
        let mut slept = Duration::ZERO;
        for round in 0..1000_u32 {
            // Some answers end early, and each has some latency.
            let step = PIECE / (1 + round % 3);
            let answer = Duration::from_micros(u64::from(round % 700));
            passed += step;
            elapsed += slept + answer;
            slept = throttle.pause(step, slept + answer);
            // The delay follows the answer.
            let ahead = passed.saturating_sub(elapsed + slept);
            assert!(ahead <= 2 * PIECE, "round {round}: {ahead:?}");
        }
        let behind = (elapsed + slept).saturating_sub(passed);
        assert!(behind <= 2 * PIECE, "{behind:?}");
    }

    #[test]
    fn robot_is_hardly_ever_delayed() {
        let mut throttle = SimulationThrottle::start();
        let (mut slept, mut whole) = (Duration::ZERO, Duration::ZERO);
        let mut late = Duration::ZERO;
        for round in 0..1000_u64 {
            // Answers arrive with some latency, each fiftieth with a long one.
            let until_then = PIECE.max(slept);
            let next = match round % 50 {
                0 => Duration::from_millis(15),
                _ => Duration::from_micros(round * 7919 % 3000),
            };
            let elapsed = (until_then + next).saturating_sub(late);
            late = next;
            slept = throttle.pause(until_then, elapsed);
            whole += slept;
        }
        // Of twenty seconds.
        assert!(whole <= Duration::from_millis(400), "{whole:?}");
    }

    #[test]
    fn busy_run_is_not_delayed() {
        let mut throttle = SimulationThrottle::start();
        let long = Duration::from_millis(500);
        assert_eq!(throttle.pause(long, long), Duration::ZERO);
        // A simulation that was behind is not accelerated later.
        assert_eq!(throttle.pause(PIECE, long), Duration::ZERO);
        assert_eq!(throttle.pause(PIECE, Duration::ZERO), PIECE);
        // A delay is limited.
        let mut throttle = SimulationThrottle::start();
        assert_eq!(
            throttle.pause(Duration::from_secs(5), long),
            super::MAX_DELAY
        );
    }
}
