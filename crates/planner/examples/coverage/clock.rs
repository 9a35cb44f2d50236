//! Wall-clock time or processor time.

use std::time::{Duration, Instant};

/// Stopwatch that starts at its creation.
pub(crate) struct Clock {
    start: Instant,
    /// Processor time at the start, if processor time is measured.
    spent: Option<Duration>,
}

impl Clock {
    /// Starts the clock. Measures processor time if requested and available on the system.
    pub(crate) fn now(counts_processor_time: bool) -> Self {
        Self {
            start: Instant::now(),
            spent: processor_time().filter(|_| counts_processor_time),
        }
    }

    pub(crate) fn elapsed(&self) -> Duration {
        let spent = self.spent.zip(processor_time());
        spent.map_or_else(
            || self.start.elapsed(),
            |(begin, now)| now.saturating_sub(begin),
        )
    }
}

/// Returns the processor time of the main thread, which runs the planner.
fn processor_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}
