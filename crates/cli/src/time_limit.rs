//! Watcher that ends a computation at a time limit or on request, and reports invalid executions
//! immediately.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::answers::{Event, Observer, StopRequest};
use elbowroom::num::Rational;

use crate::interrupt::Interrupt;
use crate::output;
use crate::terminal::{ERROR, styled};
use elbowroom_executive::clock::Clock;

/// A clock since the start, with the reasons for which a computation ends early.
#[derive(Clone)]
pub(crate) struct Stopwatch {
    clock: Clock,
    interrupt: Interrupt,
    limit: Option<Duration>,
}

impl Stopwatch {
    /// Starts the clock. Only Ctrl-C ends the computation.
    pub(crate) fn start(interrupt: &Interrupt) -> Self {
        Self {
            clock: Clock::start(),
            interrupt: interrupt.clone(),
            limit: None,
        }
    }

    /// Adds a time limit, if one is given.
    #[must_use]
    pub(crate) fn with_limit(self, limit: Option<Duration>) -> Self {
        Self { limit, ..self }
    }
}

impl Observer for Stopwatch {
    fn elapsed(&mut self) -> Duration {
        self.clock.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        let is_late = |limit: Duration| self.clock.elapsed() >= limit;
        if self.interrupt.is_requested() {
            ControlFlow::Break(StopRequest::Cancelled)
        } else if self.limit.is_some_and(is_late) {
            ControlFlow::Break(StopRequest::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }

    fn notice(&mut self, event: &Event<'_>) {
        // Reported at once, because an executive may continue for days.
        if let Event::Invalid(invalid) = event {
            output::print_to_stderr(&format!("{}: {invalid}", styled(ERROR, "bug")));
        }
    }
}

/// Converts seconds to a duration.
pub(crate) fn duration(seconds: &Rational) -> Duration {
    Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
}
