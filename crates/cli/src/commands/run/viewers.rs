//! Files for viewers of a run, written at its end.

use std::path::Path;
use std::sync::Arc;

use elbowroom::execute::RunSpec;
use elbowroom::model::Task;
use elbowroom::report::trace::TraceWriter;
use elbowroom_page::PageError;

use crate::args::RunArgs;
use crate::output;
use elbowroom_executive::Error;
use elbowroom_executive::trace_buffer::{TRACE_NAME, TraceBuffer};

/// Files for viewers.
pub(super) struct Viewers<'a> {
    arguments: &'a RunArgs,
    buffer: Option<TraceBuffer>,
}

impl<'a> Viewers<'a> {
    /// Opens the viewers of the arguments.
    ///
    /// # Errors
    /// When a file cannot be written.
    pub(super) fn open(
        arguments: &'a RunArgs,
        spec: &RunSpec,
        task: &Arc<Task>,
    ) -> Result<Self, Error> {
        let files = [&arguments.perfetto, &arguments.mcap];
        if files.iter().all(|file| file.is_none()) {
            let buffer = None;
            return Ok(Self { arguments, buffer });
        }
        for file in files.iter().copied().flatten() {
            output::write_bytes(file, b"").map_err(|failure| {
                Error::new(failure.message(), failure.advice().unwrap_or_default())
            })?;
        }
        // Files for viewers contain the whole run.
        let buffer = TraceBuffer::default();
        let mut header = |line: &str| buffer.add(line);
        let written = TraceWriter::new(Arc::clone(task), &mut header).header(spec);
        written.map_err(|error| {
            Error::new(format!("cannot write the run for viewers: {error}"), "")
        })?;
        let buffer = Some(buffer);
        Ok(Self { arguments, buffer })
    }

    /// Returns the buffer that receives the trace of the run.
    pub(super) fn buffer(&self) -> Option<&TraceBuffer> {
        self.buffer.as_ref()
    }

    /// Writes the files. Failures are warnings: the run itself is complete.
    pub(super) fn close(self) {
        let Some(buffer) = self.buffer else { return };
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
