//! Watcher for Python: progress, a time limit, and Ctrl-C.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use elbowroom::answers::{Event, Observer, StopRequest};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::errors::CallError;

/// Interval between checks for signals and reports of progress.
const POLL_INTERVAL: Duration = Duration::from_millis(50);

/// Watcher that ends the work at a time limit, at Ctrl-C, or if the callback raises an exception.
pub(crate) struct ProgressObserver {
    begun: Instant,
    limit: Option<Duration>,
    callback: Option<Py<PyAny>>,
    last_poll: Instant,
    last_report: Option<Instant>,
    halt: Option<StopRequest>,
    raised: Option<PyErr>,
    /// Set if other code has received Ctrl-C.
    interrupted: Arc<AtomicBool>,
}

impl ProgressObserver {
    /// Creates a watcher whose time limit starts now.
    pub(crate) fn start(limit: Option<f64>, callback: Option<Py<PyAny>>) -> Self {
        let now = Instant::now();
        Self {
            begun: now,
            limit: limit
                .map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)),
            callback,
            last_poll: now,
            last_report: None,
            halt: None,
            raised: None,
            interrupted: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Ends the work when `flag` is set.
    pub(crate) fn with_stop_flag(self, flag: Arc<AtomicBool>) -> Self {
        let interrupted = flag;
        Self {
            interrupted,
            ..self
        }
    }

    /// Returns the flag for other receivers of Ctrl-C, such as a world in Python.
    pub(crate) fn flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.interrupted)
    }

    /// Returns `true` if Ctrl-C ended the work.
    ///
    /// # Errors
    /// The exception of the callback.
    pub(crate) fn ended(self) -> Result<bool, CallError> {
        match self.raised {
            Some(error) => Err(error.into()),
            None => Ok(self.interrupted.load(Ordering::Relaxed)),
        }
    }

    fn raise(&mut self, py: Python<'_>, error: PyErr) {
        self.halt = Some(StopRequest::Cancelled);
        if error.is_instance_of::<PyKeyboardInterrupt>(py) {
            self.interrupted.store(true, Ordering::Relaxed);
        } else {
            self.raised = Some(error);
        }
    }

    fn report(&mut self, stage: &str, done: u64, of: Option<u64>, detail: &str) {
        self.last_report = Some(Instant::now());
        if self.halt.is_some() {
            return;
        }
        let Some(callback) = &self.callback else {
            return;
        };
        let told = Python::attach(|py| callback.call1(py, (stage, done, of, detail)).map(|_| ()));
        if let Err(error) = told {
            Python::attach(|py| self.raise(py, error));
        }
    }

    fn is_report_due(&self) -> bool {
        self.callback.is_some()
            && self
                .last_report
                .is_none_or(|told| told.elapsed() >= POLL_INTERVAL)
    }
}

impl Observer for ProgressObserver {
    fn elapsed(&mut self) -> Duration {
        self.begun.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        if self.halt.is_none() {
            let now = Instant::now();
            if self.interrupted.load(Ordering::Relaxed) {
                self.halt = Some(StopRequest::Cancelled);
            } else if self.limit.is_some_and(|limit| now - self.begun >= limit) {
                self.halt = Some(StopRequest::TimeLimit);
            } else if now - self.last_poll >= POLL_INTERVAL {
                self.last_poll = now;
                Python::attach(|py| {
                    if let Err(error) = py.check_signals() {
                        self.raise(py, error);
                    }
                });
            }
        }
        self.halt
            .map_or(ControlFlow::Continue(()), ControlFlow::Break)
    }

    fn notice(&mut self, event: &Event<'_>) {
        if self.callback.is_none() {
            return;
        }
        match event {
            Event::Envelope(progress) if self.is_report_due() => {
                let detail = format!("{} widenings", progress.widenings);
                self.report("envelope", progress.steps as u64, None, &detail);
            }
            Event::Plan(progress) if progress.makespan.is_some() || self.is_report_due() => {
                let detail = match progress.makespan {
                    Some(makespan) => format!("plan {}, makespan {makespan}", progress.plans),
                    None => format!("{} plans", progress.plans),
                };
                self.report("plan", progress.states.unwrap_or_default(), None, &detail);
            }
            Event::Run(progress) if self.is_report_due() => {
                let detail = format!("{} plans", progress.plans);
                self.report("run", progress.plans as u64, None, &detail);
            }
            Event::Trials(progress) if progress.done == progress.total || self.is_report_due() => {
                self.report("trials", progress.done, Some(progress.total), "");
            }
            _ => {}
        }
    }
}
