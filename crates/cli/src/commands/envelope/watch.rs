//! Watches the clock and Ctrl-C while an envelope is computed, and shows how far it has come.

use std::ops::ControlFlow;
use std::path::PathBuf;
use std::time::Duration;

use elbowroom::answers::{Event, Halt, Watcher};

use crate::args::EnvelopeArgs;
use crate::input;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::stopwatch::{Stopwatch, duration};

/// Ends the work never, at a time limit, or at Ctrl-C.
pub(super) struct Watch {
    stopwatch: Stopwatch,
    progress: Progress,
    plan: PathBuf,
}

impl Watch {
    /// Starts to watch.
    pub(super) fn start(arguments: &EnvelopeArgs) -> Self {
        let limit = arguments.time_limit.as_ref().map(duration);
        Self {
            stopwatch: Stopwatch::start(&Interrupt::listen()).until(limit),
            progress: Progress::new(),
            plan: arguments.plan.clone(),
        }
    }
}

impl Watcher for Watch {
    fn elapsed(&mut self) -> Duration {
        self.stopwatch.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        self.stopwatch.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        match event {
            Event::Repaired(violation) => input::tell_repair(&self.plan, violation),
            Event::Envelope(progress) => {
                let (elapsed, widenings) = (self.elapsed(), progress.widenings);
                self.progress
                    .show(elapsed, || format!("{widenings} widenings"));
            }
            _ => {}
        }
    }
}
