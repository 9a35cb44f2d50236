//! The record of a run as JSON Lines: `docs/formats/trace.md`.
//!
//! A trace holds all that came in from outside: what the world reported and which plans the
//! planner made. Everything else follows from that, and a [`Replay`] shows that it does.
//!
//! Whoever reads a trace has its lines as types ([`mod@line`]), from [`Stored::read`].

mod of;
mod replay;
mod snapshot;

use std::sync::Arc;

use elbowroom_execution::{Entry, Recorder};
use elbowroom_model::Task;
use serde::Serialize;

pub use crate::line::{self, Line};
pub use replay::{
    Difference, Replay, ReplayPlanner, ReplayPreparer, ReplayWorld, Stored, TraceError,
};
pub use snapshot::{
    GoalLine, NewsLine, SituatedLine, SnapshotLine, StartLine, TakenUpLine, TurnLine, UnderWayLine,
};

/// The value of `format` in the first line of a trace.
pub const FORMAT: &str = "elbowroom-trace";
/// The version of the format.
pub const VERSION: u64 = 1;
/// The kind of the second line of a record that begins anew.
const SNAPSHOT: &str = "snapshot";
/// The kind of the first line.
const HEADER: &str = "header";

/// Writes each entry of a run as one line.
pub struct TraceWriter<'a> {
    task: Arc<Task>,
    sink: &'a mut (dyn FnMut(&str) + Send),
}

impl<'a> TraceWriter<'a> {
    /// A writer that gives each line, with its line feed, to `sink`, which keeps it at once.
    pub fn new(task: Arc<Task>, sink: &'a mut (dyn FnMut(&str) + Send)) -> Self {
        Self { task, sink }
    }

    /// The first line: what is run, as an object of the caller's choice.
    ///
    /// # Errors
    /// When `spec` cannot be written as an object.
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

/// The second line of a record that begins anew, without its line feed.
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
