//! Wall clock and stopwatch.

use std::time::{Duration, Instant, SystemTime};

use elbowroom::num::Rational;

/// Returns the current date and time.
#[allow(clippy::disallowed_methods, reason = "the executive runs in real time")]
pub fn now() -> SystemTime {
    SystemTime::now()
}

/// Stopwatch.
#[derive(Clone, Copy, Debug)]
pub struct Clock(Instant);

impl Clock {
    /// Starts the stopwatch.
    #[allow(clippy::disallowed_methods, reason = "the executive runs in real time")]
    pub fn start() -> Self {
        Self(Instant::now())
    }

    /// Starts the stopwatch. Returns a function that returns the time since then in seconds, rounded down to a
    /// millisecond.
    pub fn stopwatch() -> impl Fn() -> Rational {
        let clock = Self::start();
        move || clock.seconds()
    }

    /// Returns the time since the start.
    pub fn elapsed(self) -> Duration {
        self.0.elapsed()
    }

    /// Returns the time since the start in seconds, rounded down to a millisecond.
    pub fn seconds(self) -> Rational {
        let milliseconds = i64::try_from(self.0.elapsed().as_millis()).unwrap_or(i64::MAX);
        Rational::new(milliseconds, 1000)
    }
}
