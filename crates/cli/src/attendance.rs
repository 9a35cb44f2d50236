//! A run that is attended: people ask what it does, and ask for something else, while it goes on.
//!
//! Requests wait at a [`Desk`]. The run fetches them as observations of its world ([`Attended`]), so
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

use crate::desk::Desk;
use crate::serve::Board;

/// Who attends a run, if anybody does.
#[derive(Clone, Default)]
pub(crate) struct Attendance(Option<Attendants>);

#[derive(Clone)]
struct Attendants {
    desk: Desk,
    /// Where they ask, if not at the page alone.
    asked: Option<(Status, Board)>,
}

impl Attendance {
    /// By those who hand in requests at `desk`, and ask `status` and `board`.
    pub(crate) fn by(desk: Desk, status: Status, board: Board) -> Self {
        let asked = Some((status, board));
        Self(Some(Attendants { desk, asked }))
    }

    /// By those who only hand in requests.
    pub(crate) fn at(desk: Desk) -> Self {
        Self(Some(Attendants { desk, asked: None }))
    }

    /// The run goes on as it stood, and what was before is no longer known.
    pub(crate) fn begin_at(&self, snapshot: &SnapshotLine) {
        if let Some((status, board)) = self.0.as_ref().and_then(|it| it.asked.as_ref()) {
            status.begin_at(snapshot);
            board.add(&format!("{}\n", snapshot_text(snapshot)));
        }
    }

    /// Where requests wait.
    pub(crate) fn desk(&self) -> Option<&Desk> {
        self.0.as_ref().map(|attendants| &attendants.desk)
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
            if let Some((status, board)) = &attendants.asked {
                status.record(entry);
                let line = Line::of(&self.task, entry);
                board.add(&format!("{}\n", line.text()));
            }
            let desk = &attendants.desk;
            match entry {
                Entry::Passed { observations, .. } => {
                    self.to_come = observations.len();
                    if !self.written_ahead {
                        desk.note_recorded();
                    }
                }
                Entry::Taken { .. } => {
                    self.to_come = self.to_come.saturating_sub(1);
                }
                _ => return,
            }
            if self.to_come == 0 {
                desk.acknowledge();
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
