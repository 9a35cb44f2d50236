//! The record of a run as JSON Lines: `docs/formats/trace.md`.
//!
//! A trace holds all that came in from outside: what the world reported and which plans the
//! planner made. Everything else follows from that, and a [`Replay`] shows that it does.

mod entry;
mod replay;

use std::sync::Arc;

use elbowroom_execution::{Entry, Recorder};
use elbowroom_model::Task;
use serde_json::Value;

pub use entry::{entry, report};
pub use replay::{Difference, Replay, ReplayPlanner, ReplayWorld, Stored, TraceError};

/// What the first line says the trace is.
pub const FORMAT: &str = "elbowroom-trace";
/// The version of the format.
pub const VERSION: u64 = 1;

/// Writes each entry of a run as one line.
pub struct TraceWriter<'a> {
    task: Arc<Task>,
    sink: &'a mut dyn FnMut(&str),
}

impl<'a> TraceWriter<'a> {
    /// A writer that gives each line, with its line feed, to `sink`, which keeps it at once.
    pub fn new(task: Arc<Task>, sink: &'a mut dyn FnMut(&str)) -> Self {
        Self { task, sink }
    }

    /// The first line: what is run, by fields of the caller's choice.
    pub fn header(&mut self, mut fields: Value) {
        fields["event"] = "header".into();
        fields["format"] = FORMAT.into();
        fields["version"] = VERSION.into();
        (self.sink)(&format!("{fields}\n"));
    }
}

impl Recorder for TraceWriter<'_> {
    fn record(&mut self, recorded: &Entry<'_>) {
        let line = entry(&self.task, recorded);
        (self.sink)(&format!("{line}\n"));
    }

    fn know(&mut self, task: &Arc<Task>) {
        self.task = Arc::clone(task);
    }
}
