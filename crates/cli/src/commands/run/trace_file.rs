//! File of a trace, written line by line.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use crate::exit::Failure;
use elbowroom_executive::messages::io_error_message;

/// Limit on the size of a trace that is kept in memory, in bytes.
const MAX_BUFFERED: usize = 32 << 20;

/// A trace file. Each line is passed to the operating system immediately, so that a killed run
/// leaves its trace.
///
/// Without a file, the trace is kept in memory until the run is known to be valid.
pub(super) struct TraceFile {
    file: Option<(File, String)>,
    buffered: String,
    error: Option<std::io::Error>,
}

impl TraceFile {
    pub(super) fn open(path: Option<&Path>) -> Result<Self, Failure> {
        let open = |path: &Path| -> Result<(File, String), Failure> {
            let name = path.display().to_string();
            let file = File::create(path).map_err(|error| {
                Failure::new(
                    format!(
                        "cannot write the trace {name}: {}",
                        io_error_message(&error)
                    ),
                    "choose a file in an existing, writable folder",
                )
            })?;
            Ok((file, name))
        };
        Ok(Self {
            file: path.map(open).transpose()?,
            buffered: String::new(),
            error: None,
        })
    }

    /// Writes a line with its line feed, unless writing has failed before.
    pub(super) fn write(&mut self, line: &str) {
        match (&mut self.file, &self.error) {
            (Some((file, _)), None) => self.error = file.write_all(line.as_bytes()).err(),
            (None, _) if self.buffered.len() < MAX_BUFFERED => self.buffered.push_str(line),
            _ => {}
        }
    }

    /// Returns the name of a file with the trace of an invalid run, and writes it if there is none yet.
    pub(super) fn of_invalid_run(&self) -> Option<String> {
        if let Some((_, name)) = &self.file {
            return Some(name.clone());
        }
        let name = format!("elbowroom-invalid-run-{}.jsonl", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, &self.buffered).ok()?;
        Some(path.display().to_string())
    }

    /// Closes the file. Returns a message if some lines could not be written.
    pub(super) fn close(self) -> Option<String> {
        let ((_, name), error) = (self.file?, self.error?);
        let why = io_error_message(&error);
        Some(format!(
            "the trace {name} is incomplete: {why}; is the disk full?"
        ))
    }
}
