//! The one place that looks at a clock.

use std::time::{Duration, Instant, SystemTime};

use elbowroom::num::Rational;

/// Returns the current date and time.
#[allow(
    clippy::disallowed_methods,
    reason = "the command line is where dates come from"
)]
pub(crate) fn now() -> SystemTime {
    SystemTime::now()
}

/// Measures the time since it was started.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock(Instant);

impl Clock {
    /// Starts to measure.
    #[allow(
        clippy::disallowed_methods,
        reason = "the command line is where the library's clock comes from"
    )]
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// How long ago it was started.
    pub(crate) fn elapsed(self) -> Duration {
        self.0.elapsed()
    }

    /// The same in seconds, in thousandths, as the library counts time.
    pub(crate) fn seconds(self) -> Rational {
        let milliseconds = i64::try_from(self.0.elapsed().as_millis()).unwrap_or(i64::MAX);
        Rational::new(milliseconds, 1000)
    }
}
