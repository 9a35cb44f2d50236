//! Ends a run when the user asks to, and lends it a clock.

use std::ops::ControlFlow;
use std::time::Duration;

use elbowroom::answers::{Halt, Watcher};

use crate::clock::Clock;
use crate::interrupt::Interrupt;

/// Watches a run.
pub(super) struct Watch {
    clock: Clock,
    interrupt: Interrupt,
}

impl Watch {
    pub(super) fn new(interrupt: &Interrupt) -> Self {
        Self {
            clock: Clock::start(),
            interrupt: interrupt.clone(),
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
        } else {
            ControlFlow::Continue(())
        }
    }
}
