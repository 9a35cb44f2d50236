//! The file that a trace is written to, line by line.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use crate::exit::Failure;
use crate::words::plain;

/// A trace file, or nothing at all. Each line is handed to the operating system before the next
/// thing happens, so that a run that is killed leaves its trace.
pub(super) struct TraceFile {
    file: Option<(File, String)>,
    error: Option<std::io::Error>,
}

impl TraceFile {
    pub(super) fn open(path: Option<&Path>) -> Result<Self, Failure> {
        let Some(path) = path else {
            return Ok(Self {
                file: None,
                error: None,
            });
        };
        let name = path.display().to_string();
        let file = File::create(path).map_err(|error| {
            Failure::new(
                format!("cannot write the trace {name}: {}", plain(&error)),
                "choose a file in a folder that exists and that you may write to",
            )
        })?;
        Ok(Self {
            file: Some((file, name)),
            error: None,
        })
    }

    /// Writes a line with its line feed, unless writing has failed before.
    pub(super) fn write(&mut self, line: &str) {
        if let (Some((file, _)), None) = (&mut self.file, &self.error) {
            self.error = file.write_all(line.as_bytes()).err();
        }
    }

    /// Why not all lines were written, if so.
    pub(super) fn close(self) -> Option<String> {
        let ((_, name), error) = (self.file?, self.error?);
        let why = plain(&error);
        Some(format!(
            "the trace {name} is incomplete: {why}; is the disk full?"
        ))
    }
}
