//! Worlds in Python as implementations of the world interface of [`elbowroom::execution`].

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom::execution::{Command, Observation, TimeAdvance, World, WorldError};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::wire;
use elbowroom_executive::{EmbeddedWorld, StartedAction};
use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;
use serde_json::Value;

/// World whose Python side (`elbowroom._world`) exchanges the messages of
/// `docs/reference/formats/world-protocol.md`.
pub(crate) struct PyWorld {
    adapter: Py<PyAny>,
    task: Arc<Task>,
    now: Rational,
    interrupted: Arc<AtomicBool>,
    /// The exception of the world.
    pub(crate) raised: Option<PyErr>,
}

impl PyWorld {
    /// Creates a world that sets `interrupted` at Ctrl-C.
    pub(crate) fn new(adapter: Py<PyAny>, task: &Arc<Task>, interrupted: Arc<AtomicBool>) -> Self {
        Self {
            adapter,
            task: Arc::clone(task),
            now: Rational::ZERO,
            interrupted,
            raised: None,
        }
    }

    /// Calls the Python side. Returns `None` at Ctrl-C.
    fn call<'py, A, T>(
        &mut self,
        py: Python<'py>,
        method: &str,
        arguments: A,
        take: impl FnOnce(Bound<'py, PyAny>) -> PyResult<T>,
    ) -> Result<Option<T>, WorldError>
    where
        A: pyo3::call::PyCallArgs<'py>,
    {
        let answered = self
            .adapter
            .bind(py)
            .call_method1(method, arguments)
            .and_then(take);
        match answered {
            Ok(value) => Ok(Some(value)),
            Err(error) if error.is_instance_of::<PyKeyboardInterrupt>(py) => {
                self.interrupted.store(true, Ordering::Relaxed);
                Ok(None)
            }
            Err(error) => {
                let message = error.to_string();
                self.raised.get_or_insert(error);
                Err(WorldError::new(message).reachable())
            }
        }
    }
}

impl PyWorld {
    /// Notifies the Python side of an invalid answer, as of an exception.
    fn check_answer<T>(&self, answer: Result<T, WorldError>) -> Result<T, WorldError> {
        answer.map_err(|error| {
            // The error of the answer takes precedence.
            let _ = Python::attach(|py| self.adapter.call_method0(py, "begin_end").map(|_| ()));
            error.reachable()
        })
    }
}

impl World for PyWorld {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        Python::attach(|py| {
            let now = now.to_string();
            let done = match command {
                Command::Start {
                    ticket,
                    action,
                    duration,
                } => {
                    let duration = duration.as_ref().map(ToString::to_string);
                    let told = (now, ticket.0, action.name.as_str(), duration);
                    self.call(py, "start", told, |_| Ok(()))
                }
                Command::Cancel { ticket } => self.call(py, "cancel", (now, ticket.0), |_| Ok(())),
            };
            done.map(|_| ())
        })
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let answered = Python::attach(|py| {
            self.call(py, "wait", (until.to_string(),), |it| {
                it.extract::<String>()
            })
        })?;
        let Some(text) = answered else {
            let now = self.now.clone();
            let observations = Vec::new();
            return Ok(TimeAdvance { now, observations });
        };
        let passage = self.check_answer(read_passage(&text, &self.task))?;
        self.now = passage.now.clone();
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        let (facts, fluents) = names(&self.task, facts, fluents);
        let answered = Python::attach(|py| {
            self.call(py, "look", (facts, fluents), |it| it.extract::<String>())
        })?;
        match answered {
            Some(text) => self.check_answer(read_observations(&text, &self.task)),
            None => Ok(Vec::new()),
        }
    }
}

impl EmbeddedWorld for PyWorld {
    fn recall(
        &mut self,
        now: &Rational,
        running: &[StartedAction],
    ) -> Result<Option<TimeAdvance>, WorldError> {
        let running = running.iter().map(|it| {
            let duration = it.duration.as_ref().map(ToString::to_string);
            (
                it.ticket.0,
                it.action.as_str(),
                duration,
                it.ordered.to_string(),
            )
        });
        let told = (now.to_string(), running.collect::<Vec<_>>());
        let answered = Python::attach(|py| {
            self.call(py, "recall", told, |it| it.extract::<Option<String>>())
        })?;
        let Some(text) = answered.flatten() else {
            return Ok(None);
        };
        let passage = self.check_answer(read_passage(&text, &self.task))?;
        self.now = passage.now.clone();
        Ok(Some(passage))
    }
}

/// Returns the names of the facts and fluents to observe.
pub(crate) fn names(
    task: &Task,
    facts: &[FactId],
    fluents: &[FluentId],
) -> (Vec<String>, Vec<String>) {
    let facts = facts.iter().map(|&fact| task.fact_name(fact));
    let fluents = fluents.iter().map(|&fluent| task.fluent_name(fluent));
    (facts.collect(), fluents.collect())
}

/// Reads the answer to a wait: `{"now": …, "observations": […]}`.
pub(crate) fn read_passage(text: &str, task: &Task) -> Result<TimeAdvance, WorldError> {
    let message = read(text)?;
    let now =
        wire::field_number(&message, "now").map_err(|error| WorldError::new(error.message))?;
    let observations = read_observation_list(message.get("observations"), task)?;
    Ok(TimeAdvance { now, observations })
}

/// Reads the answer to a look: a list of observations.
pub(crate) fn read_observations(text: &str, task: &Task) -> Result<Vec<Observation>, WorldError> {
    read_observation_list(Some(&read(text)?), task)
}

fn read(text: &str) -> Result<Value, WorldError> {
    serde_json::from_str(text).map_err(|error| WorldError::new(error.to_string()))
}

fn read_observation_list(
    list: Option<&Value>,
    task: &Task,
) -> Result<Vec<Observation>, WorldError> {
    let list = list.and_then(Value::as_array);
    let list = list.ok_or_else(|| WorldError::new("the observations must be a list"))?;
    let read = |it| wire::read_observation(it, task);
    let read: Result<Vec<_>, _> = list.iter().map(read).collect();
    read.map_err(|error| WorldError::new(error.message))
}
