//! How far a world is held back while a plan is made beside the run.

use std::time::Duration;

use elbowroom_executive::clock::Clock;

/// So far at most a world is held back at once.
const AT_MOST: Duration = Duration::from_millis(100);

/// Holds back a world that would run ahead of the wall clock, a simulation, but not a robot, whose time
/// passes by itself.
///
/// Which of the two it is, an answer tells before which nobody has slept: the time of a robot has passed here,
/// too, that of a simulation has not. After a sleep the two look alike, so that answers that come then
/// are counted and not slept on.
#[derive(Debug)]
pub(super) struct Held {
    /// Measures the time since the last answer.
    since: Clock,
    /// How far the world is ahead.
    ahead: Duration,
    /// Whether it was slept since the last answer.
    has_slept: bool,
}

impl Held {
    /// Of a world that is not ahead.
    pub(super) fn start() -> Self {
        Self {
            since: Clock::start(),
            ahead: Duration::ZERO,
            has_slept: false,
        }
    }

    /// How long the next question is to wait, when an answer came until which so much has passed in the world
    /// since the one before.
    pub(super) fn after(&mut self, passed: Duration) -> Duration {
        let elapsed = self.since.elapsed();
        self.since = Clock::start();
        self.pause(passed, elapsed)
    }

    fn pause(&mut self, passed: Duration, elapsed: Duration) -> Duration {
        let has_slept = std::mem::take(&mut self.has_slept);
        // Answers are late by a different amount each time.
        if !has_slept && passed <= elapsed + passed / 4 {
            self.ahead = Duration::ZERO;
            return Duration::ZERO;
        }
        self.ahead = (self.ahead + passed).saturating_sub(elapsed).min(AT_MOST);
        if has_slept {
            return Duration::ZERO;
        }
        self.has_slept = !self.ahead.is_zero();
        self.ahead
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::Held;

    const PIECE: Duration = Duration::from_millis(20);

    #[test]
    fn a_simulation_passes_no_faster_than_the_wall_clock() {
        let mut held = Held::start();
        let (mut passed, mut elapsed) = (Duration::ZERO, Duration::ZERO);
        let mut slept = Duration::ZERO;
        for round in 0..1000_u32 {
            // Sometimes something happens before the time that is asked for; an answer takes some time.
            let step = PIECE / (1 + round % 3);
            let answer = Duration::from_micros(u64::from(round % 700));
            passed += step;
            elapsed += slept + answer;
            slept = held.pause(step, slept + answer);
            // It is slept when the answer is there.
            let ahead = passed.saturating_sub(elapsed + slept);
            assert!(ahead <= 2 * PIECE, "round {round}: {ahead:?}");
        }
        let behind = (elapsed + slept).saturating_sub(passed);
        assert!(behind <= 2 * PIECE, "{behind:?}");
    }

    #[test]
    fn a_world_whose_time_passes_by_itself_is_hardly_ever_held_back() {
        let mut held = Held::start();
        let (mut slept, mut whole) = (Duration::ZERO, Duration::ZERO);
        let mut late = Duration::ZERO;
        for round in 0..1000_u64 {
            // It has the time of its answer, which arrives a little later. Each fiftieth is held up.
            let until_then = PIECE.max(slept);
            let next = match round % 50 {
                0 => Duration::from_millis(15),
                _ => Duration::from_micros(round * 7919 % 3000),
            };
            let elapsed = (until_then + next).saturating_sub(late);
            late = next;
            slept = held.pause(until_then, elapsed);
            whole += slept;
        }
        // Of twenty seconds.
        assert!(whole <= Duration::from_millis(400), "{whole:?}");
    }

    #[test]
    fn a_run_that_was_busy_is_not_held_back_for_it() {
        let mut held = Held::start();
        let long = Duration::from_millis(500);
        assert_eq!(held.pause(long, long), Duration::ZERO);
        // Nor is what a simulation was behind slept off later.
        assert_eq!(held.pause(PIECE, long), Duration::ZERO);
        assert_eq!(held.pause(PIECE, Duration::ZERO), PIECE);
        // A clock that cannot be held back.
        let mut held = Held::start();
        assert_eq!(held.pause(Duration::from_secs(5), long), super::AT_MOST);
    }
}
