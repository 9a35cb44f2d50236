//! Watcher for Python: progress, a time limit, and Ctrl-C.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use elbowroom::answers::{Event, Halt, Watcher};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use crate::trouble::Trouble;

/// Interval between checks for signals and reports of progress.
const GLANCE: Duration = Duration::from_millis(50);

/// Watcher that ends the work at a time limit, at Ctrl-C, or if the callback raises an exception.
pub(crate) struct Watch {
    begun: Instant,
    limit: Option<Duration>,
    callback: Option<Py<PyAny>>,
    looked: Instant,
    told: Option<Instant>,
    halt: Option<Halt>,
    raised: Option<PyErr>,
    /// Set if other code has received Ctrl-C.
    interrupted: Arc<AtomicBool>,
}

impl Watch {
    /// Creates a watcher whose time limit starts now.
    pub(crate) fn start(limit: Option<f64>, callback: Option<Py<PyAny>>) -> Self {
        let now = Instant::now();
        Self {
            begun: now,
            limit: limit
                .map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX)),
            callback,
            looked: now,
            told: None,
            halt: None,
            raised: None,
            interrupted: Arc::new(AtomicBool::new(false)),
        }
    }

    /// Ends the work when `flag` is set.
    pub(crate) fn stopped_by(self, flag: Arc<AtomicBool>) -> Self {
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
    pub(crate) fn ended(self) -> Result<bool, Trouble> {
        match self.raised {
            Some(error) => Err(error.into()),
            None => Ok(self.interrupted.load(Ordering::Relaxed)),
        }
    }

    fn raise(&mut self, py: Python<'_>, error: PyErr) {
        self.halt = Some(Halt::Cancelled);
        if error.is_instance_of::<PyKeyboardInterrupt>(py) {
            self.interrupted.store(true, Ordering::Relaxed);
        } else {
            self.raised = Some(error);
        }
    }

    fn tell(&mut self, stage: &str, done: u64, of: Option<u64>, detail: &str) {
        self.told = Some(Instant::now());
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

    fn is_time_to_tell(&self) -> bool {
        self.callback.is_some() && self.told.is_none_or(|told| told.elapsed() >= GLANCE)
    }
}

impl Watcher for Watch {
    fn elapsed(&mut self) -> Duration {
        self.begun.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<Halt> {
        if self.halt.is_none() {
            let now = Instant::now();
            if self.interrupted.load(Ordering::Relaxed) {
                self.halt = Some(Halt::Cancelled);
            } else if self.limit.is_some_and(|limit| now - self.begun >= limit) {
                self.halt = Some(Halt::TimeLimit);
            } else if now - self.looked >= GLANCE {
                self.looked = now;
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
            Event::Envelope(progress) if self.is_time_to_tell() => {
                let detail = format!("{} widenings", progress.widenings);
                self.tell("envelope", progress.steps as u64, None, &detail);
            }
            Event::Plan(progress) if progress.makespan.is_some() || self.is_time_to_tell() => {
                let detail = match progress.makespan {
                    Some(makespan) => format!("plan {}, makespan {makespan}", progress.plans),
                    None => format!("{} plans", progress.plans),
                };
                self.tell("plan", progress.states.unwrap_or_default(), None, &detail);
            }
            Event::Run(progress) if self.is_time_to_tell() => {
                let detail = format!("{} plans", progress.plans);
                self.tell("run", progress.plans as u64, None, &detail);
            }
            Event::Trials(progress) if progress.done == progress.of || self.is_time_to_tell() => {
                self.tell("trials", progress.done, Some(progress.of), "");
            }
            _ => {}
        }
    }
}
