//! When a search has to stop.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::num::Rational;

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// Why the search ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    Converged,
    CheckLimit,
    TimeLimit,
    Cancelled,
    Undecided,
}

impl Stop {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Converged => "converged",
            Self::CheckLimit => "check limit",
            Self::TimeLimit => "time limit",
            Self::Cancelled => "cancelled",
            Self::Undecided => "too many cases",
        }
    }
}

/// When to stop: never, at a time limit, or at Ctrl-C.
pub(super) struct Watch {
    clock: Clock,
    limit: Option<Duration>,
    interrupt: Interrupt,
}

impl Watch {
    /// Starts to watch the clock and Ctrl-C.
    pub(super) fn start(limit: Option<&Rational>) -> Self {
        Self {
            clock: Clock::start(),
            limit: limit.map(|seconds| {
                Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
            }),
            interrupt: Interrupt::listen(),
        }
    }

    fn is_late(&self) -> bool {
        self.limit
            .is_some_and(|limit| self.clock.elapsed() >= limit)
    }

    /// Whether to go on.
    pub(super) fn flow(&self) -> ControlFlow<()> {
        if self.interrupt.is_requested() || self.is_late() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Why not.
    pub(super) fn stop(&self) -> Stop {
        if self.interrupt.is_requested() {
            Stop::Cancelled
        } else {
            Stop::TimeLimit
        }
    }
}
