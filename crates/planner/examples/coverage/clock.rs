//! Time by the clock, or of the processor.

use std::time::{Duration, Instant};

/// Measures time from a moment on.
pub(crate) struct Clock {
    begin: Instant,
    /// The processor time at the moment, if that is what is measured.
    spent: Option<Duration>,
}

impl Clock {
    /// From now on; of the processor, if that is asked for and the system tells it.
    pub(crate) fn now(counts_processor_time: bool) -> Self {
        Self {
            begin: Instant::now(),
            spent: processor_time().filter(|_| counts_processor_time),
        }
    }

    pub(crate) fn elapsed(&self) -> Duration {
        let spent = self.spent.zip(processor_time());
        spent.map_or_else(
            || self.begin.elapsed(),
            |(begin, now)| now.saturating_sub(begin),
        )
    }
}

/// The processor time of the main thread, in which the planner runs.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}
