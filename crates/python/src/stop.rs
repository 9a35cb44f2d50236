//! Requests to stop a run, from any thread.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use pyo3::prelude::*;

/// Flag that ends a run in order: running actions are cancelled.
#[pyclass(frozen, module = "elbowroom._native")]
#[derive(Default)]
pub(crate) struct Stop {
    pub(crate) flag: Arc<AtomicBool>,
}

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Requests the end of the run.
    fn request(&self) {
        self.flag.store(true, Ordering::SeqCst);
    }
}
