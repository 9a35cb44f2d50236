//! Write-ahead journaling of a run: no action starts before its command is on the disk.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom::execution::run::RunSnapshot;
use elbowroom::execution::{
    Command, Ending, Entry, Event, Observation, Recorder, TimeAdvance, World, WorldError,
};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Line, SnapshotLine, snapshot_text};

use crate::interface::Status;
use crate::journal::JournalFile;
use crate::operator::OperatorInterface;
use crate::request_queue::RequestQueue;

/// Health of a journal, shared by its users.
#[derive(Clone, Debug, Default)]
pub struct JournalHealth(Arc<AtomicBool>);

impl JournalHealth {
    /// Returns `true` if a record could not be written.
    pub fn has_failed(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// Recorder that writes each entry to a journal.
///
/// Commands of a decision are synced to the disk before the world receives them, and requests before their clients
/// are notified. Other entries are written without a sync.
pub struct JournalWriter<'a> {
    task: Arc<Task>,
    file: &'a mut JournalFile,
    health: JournalHealth,
    /// Queue of requests that wait for a sync.
    queue: Option<RequestQueue>,
    /// Published status, whose closed goals are carried over to new segments.
    status: Option<Status>,
    /// `true` if commands were written since the last sync.
    has_commands: bool,
}

impl<'a> JournalWriter<'a> {
    /// Creates a recorder that reports failures to `health` and to the queue of the operators.
    pub fn new(
        task: &Arc<Task>,
        file: &'a mut JournalFile,
        health: &JournalHealth,
        operator: &OperatorInterface,
    ) -> Self {
        Self {
            task: Arc::clone(task),
            file,
            health: health.clone(),
            queue: operator.queue().cloned(),
            status: operator.status().cloned(),
            has_commands: false,
        }
    }

    /// Reports a failure.
    fn fail(&self) {
        self.health.0.store(true, Ordering::SeqCst);
        if let Some(queue) = &self.queue {
            queue.fail_journal();
        }
    }
}

impl Recorder for JournalWriter<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        let line = Line::of(&self.task, entry);
        let is_written = self.file.write(&format!("{}\n", line.text()));
        let is_answer = matches!(entry, Entry::Passed { .. });
        let has_requests = is_answer
            && self
                .queue
                .as_ref()
                .is_some_and(RequestQueue::has_unrecorded);
        self.has_commands |= matches!(entry, Entry::Command { .. });
        let is_safe = is_written && (!has_requests || self.file.sync());
        if !is_safe {
            self.fail();
        } else if let Some(queue) = self.queue.as_ref().filter(|_| has_requests) {
            queue.note_recorded();
        }
    }

    fn commit(&mut self) {
        if std::mem::take(&mut self.has_commands) && !self.file.sync() {
            self.fail();
        }
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> RunSnapshot) -> bool {
        self.file.needs_rotation()
            && SnapshotLine::of(&self.task, &stand()).is_some_and(|mut snapshot| {
                if let Some(status) = &self.status {
                    status.complete(&mut snapshot);
                }
                self.file.rotate(&snapshot_text(&snapshot))
            })
    }
}

/// World that starts no action after a failure of the journal. Cancellations are passed on, so that the run is shut
/// down in order.
pub struct JournaledWorld<W> {
    inner: W,
    health: JournalHealth,
    /// Failures of actions that were not started.
    refused: Vec<Observation>,
}

impl<W> JournaledWorld<W> {
    /// Wraps a world.
    pub fn new(inner: W, health: JournalHealth) -> Self {
        Self {
            inner,
            health,
            refused: Vec::new(),
        }
    }

    /// Returns the wrapped world.
    pub fn into_inner(self) -> W {
        self.inner
    }
}

impl<W: World> World for JournaledWorld<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, .. } if self.health.has_failed() => {
                let why = "it was not started: the journal cannot be written".to_owned();
                self.refused.push(Observation {
                    time: now.clone(),
                    event: Event::Ended {
                        ticket: *ticket,
                        ending: Ending::Failed { why },
                        measured: Vec::new(),
                    },
                });
                Ok(())
            }
            _ => self.inner.command(now, command),
        }
    }

    fn wait(&mut self, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut passage = self.inner.wait(until)?;
        passage.observations.append(&mut self.refused);
        Ok(passage)
    }

    fn look(
        &mut self,
        facts: &[FactId],
        fluents: &[FluentId],
    ) -> Result<Vec<Observation>, WorldError> {
        self.inner.look(facts, fluents)
    }
}
