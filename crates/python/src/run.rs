//! Runs in a simulated world, or in one in Python.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, PoisonError};

use elbowroom::answers::run::{RunOutcome, run as execute, simulate};
use elbowroom::execute::{EMBEDDED, Execution, RunInputs, RunSpec, WorldNames, check_vary};
use elbowroom::execution::executors::EXECUTORS;
use elbowroom::model;
use pyo3::prelude::*;
use serde_json::{Map, Value};

use crate::errors::{CallError, json, run_without_gil};
use crate::planner::{PyPlanner, Raised};
use crate::progress_observer::ProgressObserver;
use crate::recorder::TraceText;
use crate::stop::Stop;
use crate::task::{Task, read_options, threads};
use crate::world::PyWorld;

/// The executors: name, meaning of the number after the name, summary, source.
#[pyfunction]
pub(crate) fn executors() -> Vec<(
    &'static str,
    Option<&'static str>,
    &'static str,
    &'static str,
)> {
    let registered = EXECUTORS.iter();
    registered
        .map(|it| (it.name, it.argument, it.summary, it.paper))
        .collect()
}

/// Result of a run: the document, the trace if one was kept, `true` if Ctrl-C ended the run, and
/// the exception of the world or the planner.
type Outcome = (String, Option<String>, bool, Option<PyErr>);

/// Executes a plan in the world that the options describe, or in one in Python.
#[pyfunction]
#[expect(
    clippy::too_many_arguments,
    reason = "each is a keyword argument in Python"
)]
pub(crate) fn run(
    py: Python<'_>,
    problem: &Task,
    plan: Option<(String, String)>,
    options: &str,
    world: Option<Py<PyAny>>,
    planner: Option<Py<PyAny>>,
    has_trace: bool,
    time_limit: Option<f64>,
    progress: Option<Py<PyAny>>,
    stop: &Stop,
) -> PyResult<(String, Option<String>, bool, Option<Py<PyAny>>)> {
    let (answer, trace, is_interrupted, raised) = run_without_gil(py, || {
        let spec = problem.specification(options, plan.is_some(), planner.is_some())?;
        let watch =
            ProgressObserver::start(time_limit, progress).with_stop_flag(Arc::clone(&stop.flag));
        let raised = Raised::default();
        let task = problem.with_epsilon_of(&spec);
        let first = plan.map(|plan| problem.time_triggered(plan)).transpose()?;
        let inputs = RunInputs::of(spec, task, &WorldNames::default())?;
        inputs.spec().check_new()?;
        let mut execution = inputs.execution(first)?;
        if let Some(callable) = planner {
            let planner = problem.python_planner(callable, watch.flag(), &raised);
            execution = execution.with_planner(planner);
        }
        problem.executed((&inputs, execution), world, &raised, has_trace, watch)
    })?;
    let raised = raised.map(|error| error.into_value(py).into_any());
    Ok((answer, trace, is_interrupted, raised))
}

impl Task {
    /// Returns a planner that calls a Python callable.
    pub(crate) fn python_planner(
        &self,
        callable: Py<PyAny>,
        interrupted: Arc<AtomicBool>,
        raised: &Raised,
    ) -> PyPlanner {
        PyPlanner {
            callable,
            domain: self.domain.clone(),
            problem: self.problem.clone(),
            interrupted,
            raised: Arc::clone(raised),
        }
    }

    fn executed(
        &self,
        (inputs, execution): (&RunInputs, Execution<'_>),
        world: Option<Py<PyAny>>,
        raised: &Raised,
        has_trace: bool,
        mut watch: ProgressObserver,
    ) -> Result<Outcome, CallError> {
        let tape = if has_trace {
            Some(TraceText::of(inputs.task(), inputs.spec())?)
        } else {
            None
        };
        let execution = match tape.clone() {
            Some(tape) => execution.recorded_by(tape),
            None => execution,
        };
        let (outcome, by_world) = match world {
            Some(adapter) => {
                let mut world = PyWorld::new(adapter, &self.task, watch.flag());
                let outcome = execute(inputs, execution, &mut world, &mut watch)?;
                (outcome, world.raised)
            }
            None => (simulate(inputs, execution, &mut watch)?, None),
        };
        let RunOutcome { answer, .. } = outcome;
        let by_planner = raised.lock().unwrap_or_else(PoisonError::into_inner).take();
        let trace = tape.map(|tape| tape.text());
        let is_interrupted = watch.ended()?;
        Ok((
            json(&answer),
            trace,
            is_interrupted,
            by_world.or(by_planner),
        ))
    }

    /// Returns the specification of a run of this problem with these options.
    pub(crate) fn specification(
        &self,
        options: &str,
        has_plan: bool,
        has_planner: bool,
    ) -> Result<RunSpec, CallError> {
        let usual = RunSpec {
            has_plan,
            epsilon: self.task.epsilon().clone(),
            ..RunSpec::new((&self.domain).into(), (&self.problem).into())
        };
        let mut options: Map<String, Value> = read_options(options)?;
        // The number of threads is not part of a specification, because decisions do not depend on
        // it.
        let jobs = options.remove("jobs").filter(|jobs| !jobs.is_null());
        let jobs = jobs.map(serde_json::from_value).transpose();
        let jobs = jobs.map_err(|error| CallError::Request(format!("jobs: {error}")))?;
        let Value::Object(mut members) =
            serde_json::to_value(&usual).map_err(CallError::request)?
        else {
            return Ok(usual);
        };
        members.extend(options);
        let mut spec: RunSpec =
            serde_json::from_value(members.into()).map_err(CallError::request)?;
        check_vary(&self.task, &spec.vary).map_err(CallError::request)?;
        spec.check_planner()?;
        spec.plans_believed_durations = !has_planner && spec.usual_durations();
        spec.threads = threads(jobs, 1, spec.planner.eq_ignore_ascii_case(EMBEDDED))?;
        Ok(spec)
    }

    /// Returns the problem with the ε of the run.
    pub(crate) fn with_epsilon_of(&self, spec: &RunSpec) -> Arc<model::Task> {
        if *self.task.epsilon() == spec.epsilon {
            return Arc::clone(&self.task);
        }
        let task = (*self.task).clone();
        Arc::new(task.with_epsilon(spec.epsilon.clone()))
    }
}
