//! Executives inside the Python process.

use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use elbowroom::execution::{ActionHandle, Request};
use elbowroom_executive::interface::documents::{GivenNumber, NewGoal};
use elbowroom_executive::journal::Segments;
use elbowroom_executive::request_queue::{ExternalRequest, RequestStatus};
use elbowroom_executive::run::JournaledOutcome;
use elbowroom_executive::{ExecutiveSettings, WarningSink};
use pyo3::prelude::*;

use crate::errors::{CallError, advised, json, number, run_without_gil};
use crate::task::Task;
use crate::world::PyWorld;

/// Persistent run. One thread calls `run`; all other methods can be called from any thread.
#[pyclass(frozen, module = "elbowroom._native")]
pub(crate) struct Executive {
    inner: elbowroom_executive::Executive,
}

/// Outcome of the run: the document, the trace if all of it is kept, the reason why the journal is
/// incomplete, and the exception of the world.
type Outcome = (String, Option<String>, Option<String>, Option<Py<PyAny>>);

#[pymethods]
impl Executive {
    /// Creates an executive for the problem and the options of a run. `learn` is the folder of a
    /// model. `segments` holds the length at which a journal is rotated, and the number of earlier
    /// segments to keep. `warn` receives warnings.
    #[new]
    #[expect(
        clippy::too_many_arguments,
        reason = "the keywords of the constructor in Python"
    )]
    fn new(
        py: Python<'_>,
        problem: &Task,
        options: &str,
        journal: Option<PathBuf>,
        learn: Option<PathBuf>,
        segments: (u64, usize),
        planner_memory: Option<u64>,
        warn: Py<PyAny>,
    ) -> PyResult<Self> {
        run_without_gil(py, || {
            let spec = problem.specification(options, false, false)?;
            let settings = ExecutiveSettings {
                journal,
                ..settings(learn, segments, planner_memory, warn)
            };
            let inner = elbowroom_executive::Executive::new(spec, settings)?;
            Ok(Self { inner })
        })
    }

    /// Creates an executive that resumes the run of a journal.
    #[staticmethod]
    fn resume(
        py: Python<'_>,
        journal: PathBuf,
        learn: Option<PathBuf>,
        segments: (u64, usize),
        planner_memory: Option<u64>,
        warn: Py<PyAny>,
    ) -> PyResult<Self> {
        run_without_gil(py, || {
            let settings = settings(learn, segments, planner_memory, warn);
            let inner = elbowroom_executive::Executive::resume(&journal, settings)?;
            Ok(Self { inner })
        })
    }

    /// The description of the world if it is an object in Python.
    fn embedded_world(&self) -> Option<&str> {
        let spec = self.inner.spec();
        spec.world_process
            .as_deref()
            .filter(|_| spec.is_world_embedded)
    }

    /// Executes the run in this thread.
    fn run(&self, py: Python<'_>, world: Option<Py<PyAny>>) -> PyResult<Outcome> {
        let (outcome, raised) = run_without_gil(py, || match world {
            None => Ok((self.inner.run()?, None)),
            Some(adapter) => {
                let ignored = Arc::new(AtomicBool::new(false));
                let mut world = PyWorld::new(adapter, self.inner.task(), ignored);
                let outcome = self.inner.run_in(&mut world)?;
                Ok((outcome, world.raised))
            }
        })?;
        let JournaledOutcome {
            outcome,
            journal_failure,
        } = outcome;
        let events = self.inner.events();
        let trace = events.last_omitted_line().is_none().then(|| events.trace());
        let raised = raised.map(|error| error.into_value(py).into_any());
        Ok((json(&outcome.answer), trace, journal_failure, raised))
    }

    /// Requests an orderly end of the run.
    fn request_stop(&self) {
        self.inner.stop();
    }

    /// Submits a goal. Returns its name, and the state of the request after at most `timeout` seconds.
    #[expect(
        clippy::too_many_arguments,
        reason = "each is a keyword argument in Python"
    )]
    fn submit_goal(
        &self,
        py: Python<'_>,
        goal: String,
        name: Option<String>,
        value: Option<&str>,
        deadline: Option<&str>,
        within: Option<&str>,
        release: Option<&str>,
        after: Option<&str>,
        keep: bool,
        by: Option<String>,
        timeout: f64,
    ) -> PyResult<(String, &'static str)> {
        run_without_gil(py, || {
            let given = |text: Option<&str>, what| {
                let given = text.map(|text| number(text, what)).transpose()?;
                Ok::<_, CallError>(given.map(GivenNumber))
            };
            let goal = NewGoal {
                name,
                goal,
                value: given(value, "value")?,
                deadline: given(deadline, "deadline")?,
                within: given(within, "within")?,
                release: given(release, "release")?,
                after: given(after, "after")?,
                keep,
                by,
            };
            let submitted = self.inner.submit_goal(goal, duration(timeout)?);
            let (name, status) = submitted.map_err(refused)?;
            Ok((name, status_name(status)))
        })
    }

    /// Returns the predicted outcome of a goal. Goal and answer are JSON documents.
    fn what_if(&self, py: Python<'_>, goal: &str) -> PyResult<String> {
        run_without_gil(py, || {
            let goal: NewGoal = serde_json::from_str(goal).map_err(CallError::request)?;
            Ok(json(&self.inner.what_if(goal).map_err(refused)?))
        })
    }

    /// Submits the cancellation of a goal.
    fn cancel_goal(&self, py: Python<'_>, name: String, timeout: f64) -> PyResult<&'static str> {
        self.request(py, Request::Abandon { name }, timeout)
    }

    /// Submits a pause, or its end.
    fn pause(&self, py: Python<'_>, is_paused: bool, timeout: f64) -> PyResult<&'static str> {
        let request = if is_paused {
            Request::Pause
        } else {
            Request::Resume
        };
        self.request(py, request, timeout)
    }

    /// Submits the cancellation of a running action.
    fn cancel_action(&self, py: Python<'_>, ticket: u64, timeout: f64) -> PyResult<&'static str> {
        let ticket = ActionHandle(ticket);
        self.request(py, Request::CancelAction { ticket }, timeout)
    }

    /// Submits the outcome of a running action.
    fn report_action(
        &self,
        py: Python<'_>,
        ticket: u64,
        succeeded: bool,
        timeout: f64,
    ) -> PyResult<&'static str> {
        let ticket = ActionHandle(ticket);
        self.submit(py, ExternalRequest::Outcome { ticket, succeeded }, timeout)
    }

    /// Submits an observation of a fact.
    fn report_fact(
        &self,
        py: Python<'_>,
        fact: String,
        becomes: bool,
        timeout: f64,
    ) -> PyResult<&'static str> {
        self.submit(py, ExternalRequest::Fact { fact, becomes }, timeout)
    }

    /// Submits an observation of a numeric fluent.
    fn report_number(
        &self,
        py: Python<'_>,
        fluent: String,
        value: &str,
        timeout: f64,
    ) -> PyResult<&'static str> {
        let value = number(value, "value").map_err(|error| error.into_exception(py))?;
        self.submit(py, ExternalRequest::Number { fluent, value }, timeout)
    }

    /// The state: a document.
    fn state(&self, py: Python<'_>) -> PyResult<String> {
        run_without_gil(py, || Ok(json(&self.inner.status())))
    }

    /// The goals: a document.
    fn goals(&self, py: Python<'_>) -> PyResult<String> {
        run_without_gil(py, || Ok(json(&self.inner.published().all_goals())))
    }

    /// The plan: a document.
    fn plan(&self, py: Python<'_>) -> PyResult<String> {
        run_without_gil(py, || Ok(json(&self.inner.published().plan())))
    }

    /// Returns `true` if the run has processed all requests.
    fn is_idle(&self) -> bool {
        self.inner.is_idle()
    }

    /// Returns `true` if the run is still replaying its journal, so that its state is a past one.
    fn is_replayed(&self) -> bool {
        self.inner.published().is_replayed()
    }

    /// The lines of the trace after line `sent`, the number of earlier lines that are no longer
    /// kept, the number of the last line, and `True` if the run has ended. Waits at most `timeout`
    /// seconds for a line.
    fn lines_after(
        &self,
        py: Python<'_>,
        sent: usize,
        timeout: f64,
    ) -> PyResult<(Vec<String>, usize, usize, bool)> {
        run_without_gil(py, || {
            let new = self.inner.events().lines_after(sent, duration(timeout)?);
            Ok((new.lines, new.missed, new.last, new.is_finished))
        })
    }

    /// Waits at most `timeout` seconds for a line after line `sent`. Returns the number of the last
    /// line, and `True` if the run has ended.
    fn last_line(&self, py: Python<'_>, sent: usize, timeout: f64) -> PyResult<(usize, bool)> {
        let (_, _, last, is_over) = self.lines_after(py, sent, timeout)?;
        Ok((last, is_over))
    }
}

impl Executive {
    fn request(&self, py: Python<'_>, request: Request, timeout: f64) -> PyResult<&'static str> {
        self.submit(py, ExternalRequest::Request(request), timeout)
    }

    fn submit(
        &self,
        py: Python<'_>,
        request: ExternalRequest,
        timeout: f64,
    ) -> PyResult<&'static str> {
        run_without_gil(py, || {
            let status = self.inner.submit(request, duration(timeout)?);
            status.map(status_name).map_err(refused)
        })
    }
}

fn settings(
    learn: Option<PathBuf>,
    (size, kept): (u64, usize),
    planner_memory: Option<u64>,
    warn: Py<PyAny>,
) -> ExecutiveSettings {
    let usual = ExecutiveSettings::default();
    ExecutiveSettings {
        learn,
        segments: Some(Segments { size, kept }),
        planner_memory: planner_memory.or(usual.planner_memory),
        // An exception of the receiver is ignored.
        warnings: WarningSink::new(move |text| {
            let _ = Python::attach(|py| warn.call1(py, (text,)));
        }),
        ..usual
    }
}

fn refused(error: elbowroom_executive::Error) -> CallError {
    CallError::Request(advised(&error))
}

fn duration(seconds: f64) -> Result<Duration, CallError> {
    Duration::try_from_secs_f64(seconds).map_err(CallError::request)
}

fn status_name(status: RequestStatus) -> &'static str {
    match status {
        RequestStatus::Accepted => "accepted",
        RequestStatus::Pending => "pending",
        RequestStatus::JournalFailed => "journal-failed",
        RequestStatus::RunEnded => "run-ended",
    }
}
