//! A run that is shown elsewhere, too: in browsers while it goes on, in other viewers afterwards.

use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::RunSpec;
use elbowroom::execution::run::Stand;
use elbowroom::execution::{Entry, Recorder};
use elbowroom::model::Task;
use elbowroom::report::trace::{Line, TraceWriter};
use elbowroom_page::PageError;

use crate::args::RunArgs;
use crate::attendance::Attendance;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::output;
use crate::serve::{self, Board, Control, NAME};

/// Keeps a record, and shows it if that is asked for.
pub(super) struct Shown<R> {
    inner: R,
    task: Arc<Task>,
    board: Option<Board>,
}

impl<R: Recorder> Recorder for Shown<R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(board) = &self.board {
            board.add(&format!("{}\n", Line::of(&self.task, entry).text()));
        }
    }

    fn commit(&mut self) {
        self.inner.commit();
    }

    fn begin_anew(&mut self, stand: &dyn Fn() -> Stand) -> bool {
        self.inner.begin_anew(stand)
    }
}

/// The other places at which a run is shown: browsers and viewers.
pub(super) struct Views<'a> {
    arguments: &'a RunArgs,
    board: Option<Board>,
}

impl<'a> Views<'a> {
    /// Opens those that are asked for, so that one that cannot be had is told before anything is
    /// done.
    pub(super) fn open(
        arguments: &'a RunArgs,
        spec: &RunSpec,
        task: &Arc<Task>,
        interrupt: &Interrupt,
        attendance: &Attendance,
    ) -> Result<Self, Failure> {
        let files = [&arguments.perfetto, &arguments.mcap];
        if arguments.serve.is_none() && files.iter().all(|file| file.is_none()) {
            let board = None;
            return Ok(Self { arguments, board });
        }
        for file in files.iter().copied().flatten() {
            output::write_bytes(file, b"")?;
        }
        // What is written for viewers in the end is the whole run.
        let is_for_viewers = files.iter().any(|file| file.is_some());
        let board = if spec.is_lasting && !is_for_viewers {
            Board::lasting()
        } else {
            Board::default()
        };
        let mut header = |line: &str| board.add(line);
        let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
        written.map_err(|error| Failure::new(format!("cannot show the run: {error}"), ""))?;
        if let Some(address) = arguments.serve {
            let control = match &arguments.control {
                Some(path) => Some(Control::read(path, interrupt.clone())?),
                None => None,
            };
            serve::start(address, board.clone(), control, attendance.desk().cloned())?;
        }
        let board = Some(board);
        Ok(Self { arguments, board })
    }

    /// A record that is shown, too.
    pub(super) fn shown<R: Recorder>(&self, inner: R, task: &Arc<Task>) -> Shown<R> {
        Shown {
            inner,
            task: Arc::clone(task),
            board: self.board.clone(),
        }
    }

    /// Says that the run is over, and writes it for viewers. What goes wrong there is a warning: the
    /// run has been what it was.
    pub(super) fn close(self) {
        let Some(board) = self.board else { return };
        board.close();
        let trace = board.trace();
        let write = |file: &Path, made: Result<Vec<u8>, PageError>| match made {
            Ok(bytes) => output::write_bytes(file, &bytes)
                .err()
                .map(|failure| failure.message().to_owned()),
            Err(error) => Some(error.to_string()),
        };
        let perfetto = self.arguments.perfetto.as_ref();
        let mcap = self.arguments.mcap.as_ref();
        let troubles = [
            perfetto.and_then(|file| write(file, elbowroom_page::perfetto(NAME, &trace))),
            mcap.and_then(|file| write(file, elbowroom_page::mcap(NAME, &trace))),
        ];
        for trouble in troubles.into_iter().flatten() {
            output::warn(&trouble);
        }
    }
}
