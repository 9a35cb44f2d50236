//! The native module of the Python package `elbowroom`.
//!
//! Arguments and results are texts: PDDL, plans, options as JSON, and the answers of
//! [`elbowroom::answers`] as the JSON documents described in `docs/reference/formats`. The Python side
//! (`crates/python/python/elbowroom`) converts them to objects with exact fractions, and computes
//! no part of an answer. The answer is therefore identical, byte for byte, to that of the command.
//!
//! Long computations release the interpreter's lock, call a progress callback, and end at Ctrl-C
//! with the intermediate result (`watch`). A panic becomes the exception `elbowroom.BugError`
//! (`trouble`).
//!
//! ```python
//! import elbowroom
//!
//! problem = elbowroom.read("domain.pddl", "problem.pddl")
//! print(problem.envelope("plan.plan"))
//! ```
#![allow(
    clippy::needless_pass_by_value,
    clippy::type_complexity,
    reason = "Python passes and receives owned values and tuples"
)]
#![allow(
    clippy::disallowed_methods,
    reason = "an entry point reads the clock, as the command does"
)]
#![allow(
    clippy::struct_field_names,
    reason = "a Python class has the name of the wrapped type"
)]

mod campaign;
mod command;
mod errors;
mod executive;
mod odds;
mod planner;
mod plans;
mod progress_observer;
mod recorder;
mod run;
mod stepper;
mod stop;
mod task;
mod world;

use pyo3::prelude::*;

/// The native module.
#[pymodule(name = "_native")]
mod native {
    #[pymodule_export]
    use crate::campaign::{Experiment, experiment_files};
    #[pymodule_export]
    use crate::command::command;
    #[pymodule_export]
    use crate::errors::panic_for_test;
    #[pymodule_export]
    use crate::executive::Executive;
    #[pymodule_export]
    use crate::odds::odds;
    #[pymodule_export]
    use crate::plans::Plans;
    #[pymodule_export]
    use crate::run::{executors, run};
    #[pymodule_export]
    use crate::stepper::Stepper;
    #[pymodule_export]
    use crate::stop::Stop;
    #[pymodule_export]
    use crate::task::{Task, read};

    use elbowroom::execution::executors::DEFAULT_EXECUTOR;
    use pyo3::prelude::*;

    /// The version of the package.
    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("DEFAULT_EXECUTOR", DEFAULT_EXECUTOR)
    }
}
