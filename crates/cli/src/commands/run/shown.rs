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
use crate::exit::Failure;
use crate::interrupt::Interrupt;
use crate::output;
use elbowroom_executive::http::{AccessControl, PageServer};
use elbowroom_executive::operator::OperatorInterface;
use elbowroom_executive::trace_buffer::{TRACE_NAME, TraceBuffer};

/// Keeps a record, and shows it if that is asked for.
pub(super) struct Shown<R> {
    inner: R,
    task: Arc<Task>,
    buffer: Option<TraceBuffer>,
}

impl<R: Recorder> Recorder for Shown<R> {
    fn record(&mut self, entry: &Entry<'_>) {
        self.inner.record(entry);
        if let Some(buffer) = &self.buffer {
            buffer.add(&format!("{}\n", Line::of(&self.task, entry).text()));
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
    buffer: Option<TraceBuffer>,
}

impl<'a> Views<'a> {
    /// Opens those that are asked for, so that one that cannot be had is told before anything is
    /// done.
    pub(super) fn open(
        arguments: &'a RunArgs,
        spec: &RunSpec,
        task: &Arc<Task>,
        interrupt: &Interrupt,
        operator: &OperatorInterface,
    ) -> Result<Self, Failure> {
        let files = [&arguments.perfetto, &arguments.mcap];
        if arguments.serve.is_none() && files.iter().all(|file| file.is_none()) {
            let buffer = None;
            return Ok(Self { arguments, buffer });
        }
        for file in files.iter().copied().flatten() {
            output::write_bytes(file, b"")?;
        }
        // What is written for viewers in the end is the whole run.
        let is_for_viewers = files.iter().any(|file| file.is_some());
        let buffer = if spec.is_lasting && !is_for_viewers {
            TraceBuffer::bounded()
        } else {
            TraceBuffer::default()
        };
        let mut header = |line: &str| buffer.add(line);
        let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
        written.map_err(|error| Failure::new(format!("cannot show the run: {error}"), ""))?;
        if let Some(address) = arguments.serve {
            let control = match &arguments.control {
                Some(path) => Some(AccessControl::read(path, interrupt.stop().clone())?),
                None => None,
            };
            let with_token = if control.is_some() {
                "; with #token=TOKEN at its end, the run can be paused, cancelled and stopped there"
            } else {
                ""
            };
            let queue = operator.queue().cloned();
            let own = PageServer::start(address, buffer.clone(), control, queue)?;
            output::tell(&format!("the run is shown at http://{own}/{with_token}"));
        }
        let buffer = Some(buffer);
        Ok(Self { arguments, buffer })
    }

    /// A record that is shown, too.
    pub(super) fn shown<R: Recorder>(&self, inner: R, task: &Arc<Task>) -> Shown<R> {
        Shown {
            inner,
            task: Arc::clone(task),
            buffer: self.buffer.clone(),
        }
    }

    /// Says that the run is over, and writes it for viewers. What goes wrong there is a warning: the
    /// run has been what it was.
    pub(super) fn close(self) {
        let Some(buffer) = self.buffer else { return };
        buffer.close();
        let trace = buffer.trace();
        let write = |file: &Path, made: Result<Vec<u8>, PageError>| match made {
            Ok(bytes) => output::write_bytes(file, &bytes)
                .err()
                .map(|failure| failure.message().to_owned()),
            Err(error) => Some(error.to_string()),
        };
        let perfetto = self.arguments.perfetto.as_ref();
        let mcap = self.arguments.mcap.as_ref();
        let troubles = [
            perfetto.and_then(|file| write(file, elbowroom_page::perfetto(TRACE_NAME, &trace))),
            mcap.and_then(|file| write(file, elbowroom_page::mcap(TRACE_NAME, &trace))),
        ];
        for trouble in troubles.into_iter().flatten() {
            output::warn(&trouble);
        }
    }
}
