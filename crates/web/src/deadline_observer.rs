//! Time limits, based on the caller's clock.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::answers::{Observer, StopRequest};

/// Watcher that ends the work at a time limit, if there is one.
pub(crate) struct DeadlineObserver<'a> {
    clock: &'a mut (dyn FnMut() -> Duration + Send),
    begun: Duration,
    limit: Option<Duration>,
}

impl<'a> DeadlineObserver<'a> {
    /// Creates a watcher whose time limit starts now.
    pub(crate) fn start(
        clock: &'a mut (dyn FnMut() -> Duration + Send),
        limit: Option<Duration>,
    ) -> Self {
        let begun = clock();
        Self {
            clock,
            begun,
            limit,
        }
    }
}

impl Observer for DeadlineObserver<'_> {
    fn elapsed(&mut self) -> Duration {
        (self.clock)().saturating_sub(self.begun)
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        let Some(limit) = self.limit else {
            return ControlFlow::Continue(());
        };
        if self.elapsed() >= limit {
            ControlFlow::Break(StopRequest::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }
}
