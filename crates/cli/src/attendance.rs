//! A run that is attended: people ask what it does, and ask for something else, while it goes on.
//!
//! Requests wait at a [`RequestQueue`]. The run fetches them as observations of its world ([`Attended`]), so
//! that they stand in its record and it never waits for anybody.

mod held;
mod world;

use std::sync::Arc;

use elbowroom::execution::run::Stand;
use elbowroom::execution::{Entry, Recorder};
use elbowroom::executive::Status;
use elbowroom::model::Task;
use elbowroom::report::trace::{Line, SnapshotLine, snapshot_text};

pub(crate) use world::Attended;

use elbowroom_executive::request_queue::RequestQueue;
use elbowroom_executive::trace_buffer::TraceBuffer;

/// Who attends a run, if anybody does.
#[derive(Clone, Default)]
pub(crate) struct Attendance(Option<Attendants>);

#[derive(Clone)]
struct Attendants {
    queue: RequestQueue,
    /// Where they ask, if not at the page alone.
    asked: Option<(Status, TraceBuffer)>,
}

impl Attendance {
    /// By those who hand in requests at `queue`, and ask `status` and `buffer`.
    pub(crate) fn by(queue: RequestQueue, status: Status, buffer: TraceBuffer) -> Self {
        let asked = Some((status, buffer));
        Self(Some(Attendants { queue, asked }))
    }

    /// By those who only hand in requests.
    pub(crate) fn at(queue: RequestQueue) -> Self {
        Self(Some(Attendants { queue, asked: None }))
    }

    /// The run goes on as it stood, and what was before is no longer known.
    pub(crate) fn begin_at(&self, snapshot: &SnapshotLine) {
        if let Some((status, buffer)) = self.0.as_ref().and_then(|it| it.asked.as_ref()) {
            status.begin_at(snapshot);
            buffer.add(&format!("{}\n", snapshot_text(snapshot)));
        }
    }

    /// Where requests wait.
    pub(crate) fn queue(&self) -> Option<&RequestQueue> {
        self.0.as_ref().map(|attendants| &attendants.queue)
    }

    /// Where they ask how it stands.
    pub(crate) fn status(&self) -> Option<&Status> {
        let asked = self.0.as_ref().and_then(|it| it.asked.as_ref());
        asked.map(|(status, _)| status)
    }

    /// To be told what the run believes.
    pub(crate) fn listener(&self) -> impl FnMut(&elbowroom::execution::Progression) + Send + use<> {
        let status = self.status().cloned();
        move |belief| {
            if let Some(status) = &status {
                status.believe(belief);
            }
        }
    }

    /// A record that attendants see, too. Where it is not `written_ahead`, a request is recorded as
    /// soon as this sees it.
    pub(crate) fn witnessed<R: Recorder>(
        &self,
        inner: R,
        task: &Arc<Task>,
        written_ahead: bool,
    ) -> Witnessed<R> {
        Witnessed {
            inner,
            task: Arc::clone(task),
            attendants: self.0.clone(),
            written_ahead,
            to_come: 0,
        }
    }
}

/// Keeps a record, and shows it to attendants.
pub(crate) struct Witnessed<R> {
    inner: R,
    task: Arc<Task>,
    attendants: Option<Attendants>,
    written_ahead: bool,
    /// How many of the observations that were handed to the run it has not taken in yet.
    to_come: usize,
}

impl<R: Recorder> Recorder for Witnessed<R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(attendants) = &self.attendants {
            if let Some((status, buffer)) = &attendants.asked {
                status.record(entry);
                let line = Line::of(&self.task, entry);
                buffer.add(&format!("{}\n", line.text()));
            }
            let queue = &attendants.queue;
            match entry {
                Entry::Passed { observations, .. } => {
                    self.to_come = observations.len();
                    if !self.written_ahead {
                        queue.note_recorded();
                    }
                }
                Entry::Taken { .. } => {
                    self.to_come = self.to_come.saturating_sub(1);
                }
                _ => return,
            }
            if self.to_come == 0 {
                queue.acknowledge();
            }
        }
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> Stand) -> bool {
        self.inner.begin_anew(stand)
    }
}
