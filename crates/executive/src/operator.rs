//! Interface of operators to a run: requests to the run, and its status and trace.
//!
//! Requests wait in a [`RequestQueue`]. The run drains it as observations of its world ([`InteractiveWorld`]), so that
//! requests are recorded in the trace and the run never waits for clients.

mod interactive_world;
mod throttle;

use std::sync::Arc;

use elbowroom::execution::run::RunSnapshot;
use elbowroom::execution::{Entry, Recorder};
use elbowroom::model::Task;
use elbowroom::report::trace::{Line, SnapshotLine, snapshot_text};

use crate::interface::Status;

pub use interactive_world::InteractiveWorld;

use crate::request_queue::RequestQueue;
use crate::trace_buffer::TraceBuffer;

/// Channels between operators and a run. The default has none.
#[derive(Clone, Default)]
pub struct OperatorInterface(Option<Channels>);

#[derive(Clone)]
struct Channels {
    /// Queue of a run that accepts requests.
    queue: Option<RequestQueue>,
    status: Status,
    buffer: TraceBuffer,
}

impl OperatorInterface {
    /// Creates an interface with a request queue, a status and a trace buffer.
    pub fn new(queue: RequestQueue, status: Status, buffer: TraceBuffer) -> Self {
        Self(Some(Channels {
            queue: Some(queue),
            status,
            buffer,
        }))
    }

    /// Creates an interface to a run that accepts no requests.
    pub fn read_only(status: Status, buffer: TraceBuffer) -> Self {
        Self(Some(Channels {
            queue: None,
            status,
            buffer,
        }))
    }

    /// Publishes the snapshot at which a resumed run begins.
    pub fn begin_at(&self, snapshot: &SnapshotLine) {
        if let Some(Channels { status, buffer, .. }) = &self.0 {
            status.begin_at(snapshot);
            buffer.add(&format!("{}\n", snapshot_text(snapshot)));
        }
    }

    /// Returns the request queue of a run that accepts requests.
    pub fn queue(&self) -> Option<&RequestQueue> {
        self.0.as_ref()?.queue.as_ref()
    }

    /// Returns the published status.
    pub fn status(&self) -> Option<&Status> {
        self.0.as_ref().map(|channels| &channels.status)
    }

    /// Returns a callback that publishes the belief state of the run after each answer of the world, and then
    /// acknowledges the requests that were part of the answer.
    pub fn listener(&self) -> impl FnMut(&elbowroom::execution::BeliefState) + Send + use<> {
        let channels = self.0.clone();
        move |belief| {
            let Some(channels) = &channels else { return };
            channels.status.set_belief(belief);
            if let Some(queue) = &channels.queue {
                queue.acknowledge();
            }
        }
    }

    /// Wraps a recorder so that entries are published as well. With `written_ahead`, the recorder reports when
    /// requests are on the disk; otherwise they count as recorded at once.
    pub fn publishing<R: Recorder>(
        &self,
        inner: R,
        task: &Arc<Task>,
        written_ahead: bool,
    ) -> TeeRecorder<R> {
        TeeRecorder {
            inner,
            task: Arc::clone(task),
            channels: self.0.clone(),
            written_ahead,
        }
    }
}

/// Recorder that passes entries on and publishes them to operators.
pub struct TeeRecorder<R> {
    inner: R,
    task: Arc<Task>,
    channels: Option<Channels>,
    written_ahead: bool,
}

impl<R: Recorder> Recorder for TeeRecorder<R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(channels) = &self.channels {
            channels.status.record(entry);
            let line = Line::of(&self.task, entry);
            channels.buffer.add(&format!("{}\n", line.text()));
            if let (Some(queue), Entry::Passed { .. }) = (&channels.queue, entry)
                && !self.written_ahead
            {
                queue.note_recorded();
            }
        }
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        self.inner.begin_anew(stand)
    }
}
