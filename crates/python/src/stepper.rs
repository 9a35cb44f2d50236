//! Runs driven by an event loop.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use elbowroom::answers::RunAnswer;
use elbowroom::execute::{RunInputs, WorldNames};
use elbowroom::execution::run::{Next, Run};
use elbowroom::execution::{Command, Workers, WorldError};
use elbowroom::model;
use elbowroom::num::Rational;
use pyo3::prelude::*;

use crate::errors::{CallError, json, run_without_gil};
use crate::planner::Raised;
use crate::recorder::TraceText;
use crate::task::Task;
use crate::world::{names, read_observations, read_passage};

/// A run that returns its next request, and receives the answer.
#[pyclass(frozen, module = "elbowroom._native")]
pub(crate) struct Stepper {
    run: Mutex<Run<'static>>,
    workers: Mutex<Box<dyn Workers + 'static>>,
    task: Arc<model::Task>,
    tape: Option<TraceText>,
    raised: Raised,
    /// Requests the end of the run.
    stop: Arc<AtomicBool>,
}

/// The next request of a run: its kind, and its arguments.
#[derive(IntoPyObject)]
pub(crate) enum Needed {
    Start(&'static str, String, u64, String, Option<String>),
    Cancel(&'static str, String, u64),
    Wait(&'static str, String),
    Look(&'static str, Vec<String>, Vec<String>),
    Over(&'static str, String, Option<String>),
}

/// The planner of an event loop is not interrupted.
const ALWAYS: &(dyn Fn() -> bool + Sync) = &|| true;
/// No clock is read: the options set the duration of planning in the world.
const NO_CLOCK: &(dyn Fn() -> Rational + Sync) = &|| Rational::ZERO;

#[pymethods]
impl Stepper {
    #[new]
    fn new(
        py: Python<'_>,
        problem: &Task,
        plan: Option<(String, String)>,
        options: &str,
        planner: Option<Py<PyAny>>,
        has_trace: bool,
    ) -> PyResult<Self> {
        run_without_gil(py, || {
            let spec = problem.specification(options, plan.is_some(), planner.is_some())?;
            let task = problem.with_epsilon_of(&spec);
            let first = plan.map(|plan| problem.time_triggered(plan)).transpose()?;
            let raised = Raised::default();
            let stop = Arc::new(AtomicBool::new(false));
            let is_stopped = Arc::clone(&stop);
            let inputs = RunInputs::of(spec, task, &WorldNames::default())?;
            let (spec, task) = (inputs.spec(), inputs.task());
            inputs.spec().check_new()?;
            let mut execution = inputs.execution(first)?.with_explanations();
            execution = execution.with_stop_check(move || is_stopped.load(Ordering::SeqCst));
            execution = if let Some(callable) = planner {
                execution.with_planner(problem.python_planner(callable, Arc::clone(&stop), &raised))
            } else {
                execution.with_planner(inputs.planner(NO_CLOCK, ALWAYS)?)
            };
            let tape = if has_trace {
                Some(TraceText::of(task, spec)?)
            } else {
                None
            };
            if let Some(tape) = &tape {
                execution = execution.recorded_by(tape.clone());
            }
            let (run, workers) = execution.run();
            Ok(Self {
                run: Mutex::new(run),
                workers: Mutex::new(workers),
                task: Arc::clone(task),
                tape,
                raised,
                stop,
            })
        })
    }

    /// The next request of the run.
    fn next(&self, py: Python<'_>) -> PyResult<Needed> {
        run_without_gil(py, || {
            let mut run = self.run();
            let mut workers = self.workers.lock().unwrap_or_else(PoisonError::into_inner);
            loop {
                let next = run.next();
                if let Some(error) = self
                    .raised
                    .lock()
                    .unwrap_or_else(PoisonError::into_inner)
                    .take()
                {
                    return Err(CallError::Python(error));
                }
                let now = run.now().to_string();
                return Ok(match next {
                    Next::Command(Command::Start {
                        ticket,
                        action,
                        duration,
                    }) => {
                        let duration = duration.as_ref().map(ToString::to_string);
                        Needed::Start("start", now, ticket.0, action.name.clone(), duration)
                    }
                    Next::Command(Command::Cancel { ticket }) => {
                        Needed::Cancel("cancel", now, ticket.0)
                    }
                    Next::Wait { until } => Needed::Wait("wait", until.to_string()),
                    Next::Look { facts, fluents } => {
                        let (facts, fluents) = names(&self.task, &facts, &fluents);
                        Needed::Look("look", facts, fluents)
                    }
                    Next::Over(report) => {
                        let trace = self.tape.as_ref().map(TraceText::text);
                        Needed::Over("over", json(&RunAnswer::of(&report)), trace)
                    }
                    request => {
                        run.delegate(request, &mut **workers);
                        continue;
                    }
                });
            }
        })
    }

    /// Answers a wait with the present time and the observations.
    fn observe(&self, py: Python<'_>, passage: &str) -> PyResult<()> {
        run_without_gil(py, || {
            let passage = read_passage(passage, &self.task).map_err(CallError::request)?;
            self.run().observe(passage).map_err(CallError::request)
        })
    }

    /// Answers a look with the observations.
    fn see(&self, py: Python<'_>, observations: &str) -> PyResult<()> {
        run_without_gil(py, || {
            let seen = read_observations(observations, &self.task).map_err(CallError::request)?;
            self.run()
                .observe_requested(seen)
                .map_err(CallError::request)
        })
    }

    /// Reports a failure of the world.
    fn fail(&self, py: Python<'_>, why: &str) -> PyResult<()> {
        run_without_gil(py, || {
            self.run().fail(WorldError::new(why));
            Ok(())
        })
    }

    /// Requests the end of the run.
    fn stop(&self) {
        self.stop.store(true, Ordering::SeqCst);
    }

    /// The present time, by the world's clock.
    fn now(&self) -> String {
        self.run().now().to_string()
    }
}

impl Stepper {
    fn run(&self) -> MutexGuard<'_, Run<'static>> {
        self.run.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
