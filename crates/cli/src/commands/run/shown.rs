//! A run that is shown in browsers while it runs: `--serve`.

use std::sync::Arc;

use elbowroom::execute::RunSpec;
use elbowroom::execution::{Entry, Recorder};
use elbowroom::model::Task;
use elbowroom::report::trace::{Line, TraceWriter};

use crate::args::RunArgs;
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::serve::{self, Board, Control};

/// Keeps a record, and shows it if that is asked for.
pub(super) struct Shown<R> {
    inner: R,
    task: Arc<Task>,
    board: Option<Board>,
}

impl<R: Recorder> Shown<R> {
    pub(super) fn new(inner: R, task: &Arc<Task>, board: Option<&Board>) -> Self {
        Self {
            inner,
            task: Arc::clone(task),
            board: board.cloned(),
        }
    }
}

impl<R: Recorder> Recorder for Shown<R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(board) = &self.board {
            board.add(&format!("{}\n", Line::of(&self.task, entry).text()));
        }
    }
}

/// Serves the page of a run if that is asked for.
pub(super) fn serve(
    arguments: &RunArgs,
    spec: &RunSpec,
    task: &Arc<Task>,
    interrupt: &Interrupt,
) -> Result<Option<Board>, Failure> {
    let Some(address) = arguments.serve else {
        return Ok(None);
    };
    let board = Board::default();
    let mut header = |line: &str| board.add(line);
    let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
    written.map_err(|error| Failure::new(format!("cannot show the run: {error}"), ""))?;
    let control = match &arguments.control {
        Some(path) => Some(Control::read(path, interrupt.clone())?),
        None => None,
    };
    serve::start(address, board.clone(), control)?;
    Ok(Some(board))
}
