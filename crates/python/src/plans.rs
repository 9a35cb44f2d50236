//! Iteration over plans as they are found, for Python.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use elbowroom::answers::plan::{ImprovingPlans, ImprovingPlansRequest, NextPlan};
use elbowroom::answers::{Observer, StopRequest};
use pyo3::prelude::*;

use crate::errors::{CallError, json, run_without_gil};
use crate::task::{EVERY_PROCESSOR, Task, threads};

/// Interval between two checks for signals.
const POLL_INTERVAL: Duration = Duration::from_millis(50);
/// Grace period for the answer after the end of the search. It is part of the time limit.
const GRACE: Duration = Duration::from_millis(50);

/// A search for successively better plans.
#[pyclass(frozen, module = "elbowroom._native")]
pub(crate) struct Plans {
    search: Mutex<ImprovingPlans>,
    begun: Instant,
    limit: Option<Duration>,
}

#[pymethods]
impl Plans {
    /// Starts the search and its time limit.
    #[new]
    fn new(
        py: Python<'_>,
        problem: &Task,
        time_limit: Option<f64>,
        memory: Option<u64>,
        jobs: Option<usize>,
        self_overlap: bool,
    ) -> PyResult<Self> {
        run_without_gil(py, || {
            let begun = Instant::now();
            let limit = time_limit
                .map(|seconds| Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX));
            let request = ImprovingPlansRequest {
                task: &problem.task,
                most_memory: memory,
                self_overlap,
                threads: threads(jobs, EVERY_PROCESSOR, true)?,
            };
            let clock = Clock {
                begun,
                limit: limit.map(|limit| limit.saturating_sub(GRACE.min(limit / 10))),
            };
            let search = ImprovingPlans::search(&request, Box::new(clock));
            Ok(Self {
                search: Mutex::new(search.map_err(CallError::request)?),
                begun,
                limit,
            })
        })
    }

    /// The next plan, or the answer, as a document with `True` for the answer. `None` when the time
    /// is up and the search does not answer.
    fn next(&self, py: Python<'_>) -> PyResult<Option<(String, bool)>> {
        loop {
            let left = self.limit.map(|it| it.saturating_sub(self.begun.elapsed()));
            let patience = left.map_or(POLL_INTERVAL, |left| left.min(POLL_INTERVAL));
            // The lock is only held while the interpreter's lock is released.
            let news = run_without_gil(py, || {
                let mut search = self.search.lock().unwrap_or_else(PoisonError::into_inner);
                match search.next_within(patience) {
                    NextPlan::Better(better) => {
                        Ok(PollResult::Document(json(&better.finding), false))
                    }
                    NextPlan::Timeout => Ok(PollResult::None),
                    NextPlan::Ended => match search.answer() {
                        Some(Ok(outcome)) => Ok(PollResult::Document(json(&outcome.answer), true)),
                        Some(Err(error)) => Err(CallError::Unsupported(error.to_string())),
                        None => Ok(PollResult::None),
                    },
                }
            })?;
            match news {
                PollResult::Document(document, is_last) => return Ok(Some((document, is_last))),
                PollResult::None if left.is_some_and(|left| left.is_zero()) => {
                    self.stop(py)?;
                    return Ok(None);
                }
                PollResult::None => {
                    if let Err(error) = py.check_signals() {
                        self.stop(py)?;
                        return Err(error);
                    }
                }
            }
        }
    }

    /// Stops the search.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        run_without_gil(py, || {
            let search = self.search.lock().unwrap_or_else(PoisonError::into_inner);
            search.stop();
            Ok(())
        })
    }
}

/// Result of one poll of a search.
enum PollResult {
    /// A document, with `true` if it is the answer.
    Document(String, bool),
    /// Nothing new.
    None,
}

/// Ends the search at the time limit. It runs in a thread without Python.
struct Clock {
    begun: Instant,
    limit: Option<Duration>,
}

impl Observer for Clock {
    fn elapsed(&mut self) -> Duration {
        self.begun.elapsed()
    }

    fn flow(&mut self) -> ControlFlow<StopRequest> {
        match self.limit {
            Some(limit) if self.begun.elapsed() >= limit => {
                ControlFlow::Break(StopRequest::TimeLimit)
            }
            _ => ControlFlow::Continue(()),
        }
    }
}
