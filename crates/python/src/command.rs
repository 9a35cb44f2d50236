//! The command `elbowroom`, for the script in the package.

use std::ffi::OsString;

use pyo3::prelude::*;

/// Runs the command and returns its exit code; see [`elbowroom_cli::run`].
#[pyfunction]
pub(crate) fn command(py: Python<'_>, line: Vec<OsString>) -> u8 {
    py.detach(|| elbowroom_cli::run(line))
}
