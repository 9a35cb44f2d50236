//! Time limit, Ctrl-C and progress line for the computation of an envelope.
//!
//! A single call of the library can take long without checking the time. The computation therefore
//! runs on its own thread. If it does not return shortly after the limit, the last reported
//! envelope is the answer.

use std::ops::ControlFlow;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use elbowroom::answers::envelope::{EnvelopeOutcome, EnvelopeRequest, envelope, partial_result};
use elbowroom::answers::{Event, Observer, RequestError, StopRequest};
use elbowroom::plan::{DecoupledEnvelope, ParametrizedPlan};

use crate::args::EnvelopeArgs;
use crate::interrupt::Interrupt;
use crate::progress::Progress;
use crate::time_limit::{Stopwatch, duration};

/// Interval between checks of the time limit and Ctrl-C.
const POLL_INTERVAL: Duration = Duration::from_millis(10);
/// Grace period for an answer after the time limit; longer than most steps of the library take.
const GRACE_PERIOD: Duration = Duration::from_millis(50);
/// Stack size of the worker, in bytes: that of the main thread.
const STACK_SIZE: usize = 64 << 20;

/// Watcher that ends the computation at a time limit, if there is one, or at Ctrl-C.
pub(super) struct EnvelopeMonitor {
    stopwatch: Stopwatch,
}

/// Last progress reported by the library.
#[derive(Default)]
struct LastProgress {
    found: Option<(Arc<ParametrizedPlan>, DecoupledEnvelope)>,
    widenings: usize,
    checks: usize,
}

impl EnvelopeMonitor {
    /// Creates a watcher whose time limit starts now.
    pub(super) fn start(arguments: &EnvelopeArgs) -> Self {
        let limit = arguments.time_limit.as_ref().map(duration);
        Self {
            stopwatch: Stopwatch::start(&Interrupt::listen()).with_limit(limit),
        }
    }

    /// Computes the answer, or returns the best envelope found when the time is up.
    pub(super) fn answer(
        mut self,
        request: &Arc<EnvelopeRequest>,
    ) -> Result<EnvelopeOutcome, RequestError> {
        let told = Arc::new(Mutex::new(LastProgress::default()));
        let mut listener = Listener {
            stopwatch: self.stopwatch.clone(),
            progress: Arc::clone(&told),
        };
        let (sender, receiver) = mpsc::channel();
        let theirs = Arc::clone(request);
        let worker = thread::Builder::new()
            .stack_size(STACK_SIZE)
            .spawn(move || {
                // After the time limit, the receiver is gone.
                let _ = sender.send(envelope(&theirs, &mut listener));
            });
        if worker.is_err() {
            // No thread is available: the limit is checked between steps only.
            return envelope(request, &mut self.stopwatch);
        }
        let mut progress = Progress::new();
        let mut late: Option<(StopRequest, Duration)> = None;
        loop {
            match receiver.recv_timeout(POLL_INTERVAL) {
                Ok(answer) => return answer,
                // The thread has ended without an answer: it panicked, which has ended the program.
                Err(RecvTimeoutError::Disconnected) => {
                    return envelope(request, &mut self.stopwatch);
                }
                Err(RecvTimeoutError::Timeout) => {}
            }
            let elapsed = self.stopwatch.elapsed();
            if let (ControlFlow::Break(halt), None) = (self.stopwatch.flow(), late) {
                late = Some((halt, elapsed));
            }
            let told = told.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some((halt, since)) = late
                && elapsed >= since + GRACE_PERIOD
            {
                let found = told.found.as_ref();
                let found = found.map(|(plan, envelope)| (plan, envelope, told.checks));
                return Ok(partial_result(request, found, halt, elapsed.as_secs_f64()));
            }
            let widenings = told.widenings;
            drop(told);
            progress.show(elapsed, || format!("{widenings} widenings"));
        }
    }
}

/// Watcher on the library's thread.
struct Listener {
    stopwatch: Stopwatch,
    progress: Arc<Mutex<LastProgress>>,
}

impl Observer for Listener {
    fn elapsed(&mut self) -> Duration {
        self.stopwatch.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        self.stopwatch.flow()
    }

    fn notice(&mut self, event: &Event<'_>) {
        if let Event::Envelope(progress) = event {
            let mut told = self.progress.lock().unwrap_or_else(PoisonError::into_inner);
            if told.found.is_none() || told.widenings != progress.widenings {
                told.found = Some((Arc::clone(progress.plan), progress.envelope.clone()));
                told.widenings = progress.widenings;
                told.checks = progress.checks;
            }
        }
    }
}
