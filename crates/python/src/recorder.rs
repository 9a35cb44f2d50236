//! In-memory trace of a run.

use std::sync::{Arc, Mutex, PoisonError};

use elbowroom::execute::RunSpec;
use elbowroom::execution::{Entry, Recorder};
use elbowroom::model::Task;
use elbowroom::report::trace::TraceWriter;

use crate::errors::CallError;

/// A trace as text: `docs/reference/formats/trace.md`.
#[derive(Clone)]
pub(crate) struct TraceText {
    task: Arc<Task>,
    text: Arc<Mutex<String>>,
}

impl TraceText {
    /// Creates a trace that begins with the specification of the run.
    pub(crate) fn of(task: &Arc<Task>, spec: &RunSpec) -> Result<Self, CallError> {
        let mut text = String::new();
        let mut sink = |line: &str| text.push_str(line);
        let mut writer = TraceWriter::new(Arc::clone(task), &mut sink);
        writer.header(spec).map_err(CallError::request)?;
        Ok(Self {
            task: Arc::clone(task),
            text: Arc::new(Mutex::new(text)),
        })
    }

    /// Returns the text of the trace.
    pub(crate) fn text(&self) -> String {
        self.text
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }
}

impl Recorder for TraceText {
    fn record(&mut self, entry: &Entry<'_>) {
        let mut locked = self.text.lock().unwrap_or_else(PoisonError::into_inner);
        let text = &mut *locked;
        let mut sink = |line: &str| text.push_str(line);
        TraceWriter::new(Arc::clone(&self.task), &mut sink).record(entry);
    }
}
