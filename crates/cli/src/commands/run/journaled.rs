//! A run with a journal: nothing is started that is not on the disk.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use elbowroom::execution::run::Stand;
use elbowroom::execution::{
    Command, Ending, Entry, Event, Observation, Passage, Recorder, World, WorldError,
};
use elbowroom::model::Task;
use elbowroom::model::ground::{FactId, FluentId};
use elbowroom::num::Rational;
use elbowroom::report::trace::{Line, SnapshotLine, snapshot_text};

use crate::desk::Desk;
use crate::journal::JournalFile;

/// Whether everything is on the disk that should be.
#[derive(Clone, Debug, Default)]
pub(super) struct Kept(Arc<AtomicBool>);

impl Kept {
    /// Whether a record was lost.
    pub(super) fn is_lost(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

/// Writes each entry into a journal. Before the world is told to start or to cancel something, that
/// is on the disk, together with all else that the same decision starts or cancels, and so is what people ask before they are told that it was taken in; all else is handed to the operating system at once.
pub(super) struct JournalWriter<'a> {
    task: Arc<Task>,
    file: &'a mut JournalFile,
    kept: Kept,
    /// Who waits for requests to be on the disk.
    desk: Option<Desk>,
    /// Whether commands were written since the disk was last waited for.
    has_commands: bool,
}

impl<'a> JournalWriter<'a> {
    pub(super) fn new(
        task: &Arc<Task>,
        file: &'a mut JournalFile,
        kept: &Kept,
        desk: Option<&Desk>,
    ) -> Self {
        Self {
            task: Arc::clone(task),
            file,
            kept: kept.clone(),
            desk: desk.cloned(),
            has_commands: false,
        }
    }

    /// A record was lost.
    fn lose(&self) {
        self.kept.0.store(true, Ordering::SeqCst);
        if let Some(desk) = &self.desk {
            desk.lose();
        }
    }
}

impl Recorder for JournalWriter<'_> {
    fn record(&mut self, entry: &Entry<'_>) {
        let line = Line::of(&self.task, entry);
        let is_written = self.file.write(&format!("{}\n", line.text()));
        let is_answer = matches!(entry, Entry::Passed { .. });
        let has_requests = is_answer && self.desk.as_ref().is_some_and(Desk::has_fetched);
        self.has_commands |= matches!(entry, Entry::Command { .. });
        let is_kept = is_written && (!has_requests || self.file.sync());
        if !is_kept {
            self.lose();
        } else if let Some(desk) = self.desk.as_ref().filter(|_| has_requests) {
            desk.note_recorded();
        }
    }

    fn commit(&mut self) {
        if std::mem::take(&mut self.has_commands) && !self.file.sync() {
            self.lose();
        }
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> Stand) -> bool {
        self.file.is_long()
            && SnapshotLine::of(&self.task, &stand())
                .is_some_and(|snapshot| self.file.begin_anew(&snapshot_text(&snapshot)))
    }
}

/// A world that starts nothing any more when the journal has lost a record. What runs is still told
/// to stop: the run is over, in order.
pub(super) struct Careful<W> {
    pub(super) inner: W,
    pub(super) kept: Kept,
    /// What was not started.
    pub(super) refused: Vec<Observation>,
}

impl<W: World> World for Careful<W> {
    fn command(&mut self, now: &Rational, command: &Command) -> Result<(), WorldError> {
        match command {
            Command::Start { ticket, .. } if self.kept.is_lost() => {
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

    fn wait(&mut self, until: &Rational) -> Result<Passage, WorldError> {
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
