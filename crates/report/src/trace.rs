//! Record of a run as JSON Lines: `docs/reference/formats/trace.md`.
//!
//! A trace contains all external input of the run: the reports of the world and the plans of the
//! planner. They determine everything else, and a [`Replay`] checks that.
//!
//! [`Stored::read`] parses a trace into typed lines ([`schema`]).

mod encode;
mod replay;
mod snapshot;

use std::sync::Arc;

use elbowroom_execution::{Entry, Recorder};
use elbowroom_model::Task;
use serde::Serialize;

pub use crate::schema::{self, Line};
pub use replay::{
    Difference, Replay, ReplayPlanner, ReplayPreparer, ReplayWorld, Stored, TraceError,
    action_named,
};
pub use snapshot::{
    ClosedGoalLine, GoalLine, NewsLine, PendingGoalChangeLine, PlanAdoptionLine, RunningActionLine,
    SituationActionLine, SnapshotLine, StartLine, WaitLine,
};

/// The value of `format` in the first line of a trace.
pub const FORMAT: &str = "elbowroom-trace";
/// The version of the format.
pub const VERSION: u64 = 1;
/// Kind of the second line of a rotated record.
const SNAPSHOT: &str = "snapshot";
/// The kind of the first line.
const HEADER: &str = "header";

/// Writes each entry of a run as one line.
pub struct TraceWriter<'a> {
    task: Arc<Task>,
    sink: &'a mut (dyn FnMut(&str) + Send),
}

impl<'a> TraceWriter<'a> {
    /// Creates a writer that passes each line, with its line feed, to `sink`, which must store it
    /// immediately.
    pub fn new(task: Arc<Task>, sink: &'a mut (dyn FnMut(&str) + Send)) -> Self {
        Self { task, sink }
    }

    /// Writes the first line: the specification of the run, as an object of the caller's choice.
    ///
    /// # Errors
    /// If `spec` cannot be written as an object.
    pub fn header(&mut self, spec: &impl Serialize) -> Result<(), serde_json::Error> {
        let header = serde_json::to_string(&Header {
            spec,
            event: HEADER,
            format: FORMAT,
            version: VERSION,
        })?;
        (self.sink)(&format!("{header}\n"));
        Ok(())
    }
}

/// Returns the second line of a rotated record, without its line feed.
pub fn snapshot_text(snapshot: &SnapshotLine) -> String {
    #[derive(Serialize)]
    struct Named<'a> {
        event: &'static str,
        #[serde(flatten)]
        snapshot: &'a SnapshotLine,
    }
    let event = SNAPSHOT;
    serde_json::to_string(&Named { event, snapshot })
        .expect("all keys are texts, and decimals of rationals are finite")
}

/// The first line.
#[derive(Serialize)]
struct Header<'a, T> {
    #[serde(flatten)]
    spec: &'a T,
    event: &'static str,
    format: &'static str,
    version: u64,
}

impl Recorder for TraceWriter<'_> {
    fn record(&mut self, recorded: &Entry<'_>) {
        let line = Line::of(&self.task, recorded);
        (self.sink)(&format!("{}\n", line.text()));
    }
}
