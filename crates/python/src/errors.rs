//! Errors as exceptions of the Python package.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

use elbowroom::answers::RequestError;
use elbowroom::answers::plan::PlannerFailure;
use elbowroom::execute::SpecError;
use elbowroom::num::Rational;
use elbowroom::text::Diagnostics;
use elbowroom_executive::run::RunError;
use elbowroom_laboratory::error::ExperimentError;
use pyo3::prelude::*;

/// Reason why there is no answer.
pub(crate) enum CallError {
    /// A text cannot be read.
    Read(Diagnostics),
    /// The request is invalid, or the answer is beyond the supported analyses.
    Request(String),
    /// The planner does not support a feature of the problem.
    Unsupported(String),
    /// The validator cannot decide.
    Undecided(String),
    /// An executive cannot be started or resumed.
    Executive(String),
    /// A planner could not be run.
    Planner(String),
    /// Python code has raised an exception.
    Python(PyErr),
}

impl CallError {
    pub(crate) fn request(message: impl ToString) -> Self {
        Self::Request(message.to_string())
    }

    /// Converts the error to an exception of the module `elbowroom._errors`.
    pub(crate) fn into_exception(self, py: Python<'_>) -> PyErr {
        match self {
            Self::Read(diagnostics) => {
                let records = json(&diagnostics.records());
                exception(py, "ReadError", (diagnostics.to_string(), records))
            }
            Self::Request(message) => exception(py, "RequestError", (message,)),
            Self::Unsupported(message) => exception(py, "UnsupportedError", (message,)),
            Self::Undecided(message) => exception(py, "UndecidedError", (message,)),
            Self::Executive(message) => exception(py, "ExecutiveError", (message,)),
            Self::Planner(message) => exception(py, "PlannerError", (message,)),
            Self::Python(error) => error,
        }
    }
}

impl From<Diagnostics> for CallError {
    fn from(diagnostics: Diagnostics) -> Self {
        Self::Read(diagnostics)
    }
}

impl From<RequestError> for CallError {
    fn from(error: RequestError) -> Self {
        match error {
            RequestError::Undecided(why) => Self::Undecided(why),
            RequestError::Unsupported(what) => Self::Unsupported(what),
            other => Self::request(other),
        }
    }
}

impl From<PlannerFailure> for CallError {
    fn from(failure: PlannerFailure) -> Self {
        Self::Planner(failure.to_string())
    }
}

impl From<SpecError> for CallError {
    fn from(error: SpecError) -> Self {
        match error {
            SpecError::World(wrong) | SpecError::Likelihoods(wrong) => Self::Read(wrong),
            SpecError::Planner(wrong) => Self::Planner(wrong.to_string()),
            other => Self::request(other),
        }
    }
}

impl From<RunError> for CallError {
    fn from(error: RunError) -> Self {
        match error {
            RunError::Problem(wrong) => Self::Read(wrong),
            RunError::Spec(wrong) => wrong.into(),
            RunError::Failed(error) => Self::Executive(advised(&error)),
        }
    }
}

impl From<ExperimentError> for CallError {
    fn from(error: ExperimentError) -> Self {
        match error {
            ExperimentError::Text(diagnostics) => Self::Read(diagnostics),
            other => Self::request(other),
        }
    }
}

impl From<PyErr> for CallError {
    fn from(error: PyErr) -> Self {
        Self::Python(error)
    }
}

/// Runs `work` without the interpreter's lock. Errors are raised as exceptions; a panic is raised
/// as a bug.
pub(crate) fn run_without_gil<T: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, CallError> + Send,
) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(Ok(value)) => Ok(value),
        Ok(Err(trouble)) => Err(trouble.into_exception(py)),
        Err(panic) => Err(bug(py, panic.as_ref())),
    }
}

/// Converts a panic to an exception.
fn bug(py: Python<'_>, panic: &(dyn Any + Send)) -> PyErr {
    let said = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied());
    exception(py, "BugError", (said.unwrap_or("no message").to_owned(),))
}

fn exception<'py, A>(py: Python<'py>, name: &str, arguments: A) -> PyErr
where
    A: pyo3::call::PyCallArgs<'py>,
{
    let made = py
        .import("elbowroom._errors")
        .and_then(|module| module.getattr(name))
        .and_then(|class| class.call1(arguments));
    made.map_or_else(|error| error, PyErr::from_value)
}

/// Returns the message of an error with its advice.
pub(crate) fn advised(error: &elbowroom_executive::Error) -> String {
    match error.advice() {
        "" => error.message().to_owned(),
        advice => format!("{}; {advice}", error.message()),
    }
}

/// Serializes a document.
pub(crate) fn json(document: &impl serde::Serialize) -> String {
    serde_json::to_string(document).expect("documents have texts as keys")
}

/// Parses a number, in any form that Python code writes.
pub(crate) fn number(text: &str, what: &str) -> Result<Rational, CallError> {
    text.parse()
        .map_err(|error| CallError::Request(format!("`{what}`: {error}")))
}

/// Parses a positive number.
pub(crate) fn positive(text: &str, what: &str) -> Result<Rational, CallError> {
    let number = number(text, what)?;
    if number.is_positive() {
        Ok(number)
    } else {
        let message = format!("`{what}` is {number}; it must be greater than 0");
        Err(CallError::Request(message))
    }
}

/// Panics, so that tests can check the resulting exception.
#[pyfunction(name = "_panic_for_test")]
pub(crate) fn panic_for_test(py: Python<'_>) -> PyResult<()> {
    run_without_gil(py, || panic!("a test wants to see a panic"))
}
