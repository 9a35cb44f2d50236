//! Watches the clock and Ctrl-C while an envelope is computed.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use elbowroom::answers::{Event, Halt, Watcher};

use crate::args::EnvelopeArgs;
use crate::clock::Clock;
use crate::input;
use crate::interrupt::Interrupt;
use crate::progress::Progress;

/// Ends the work never, at a time limit, or at Ctrl-C.
pub(super) struct Watch {
    clock: Clock,
    limit: Option<Duration>,
    interrupt: Interrupt,
    progress: Progress,
    plan: PathBuf,
}

impl Watch {
    /// Starts to watch.
    pub(super) fn start(arguments: &EnvelopeArgs) -> Self {
        Self {
            clock: Clock::start(),
            limit: arguments.time_limit.as_ref().map(|seconds| {
                Duration::try_from_secs_f64(seconds.to_f64()).unwrap_or(Duration::MAX)
            }),
            interrupt: Interrupt::listen(),
            progress: Progress::new(),
            plan: arguments.plan.clone(),
        }
    }
}

impl Watcher for Watch {
    fn elapsed(&mut self) -> Duration {
        self.clock.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        if self.interrupt.is_requested() {
            ControlFlow::Break(Halt::Cancelled)
        } else if self
            .limit
            .is_some_and(|limit| self.clock.elapsed() >= limit)
        {
            ControlFlow::Break(Halt::TimeLimit)
        } else {
            ControlFlow::Continue(())
        }
    }

    fn notice(&mut self, event: &Event<'_>) {
        match event {
            Event::Repaired(violation) => input::tell_repair(&self.plan, violation),
            Event::Envelope(progress) => {
                let widenings = progress.widenings;
                self.progress
                    .show(self.clock.elapsed(), || format!("{widenings} widenings"));
            }
            _ => {}
        }
    }
}
