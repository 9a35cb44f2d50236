//! Pipes to a program with timeouts. Reading and writing block, so each pipe has its own thread.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Limit on a message, in bytes.
pub const MAX_LINE: usize = 1 << 20;

/// Limit on unread bytes, and on the bytes of one answer.
pub const MAX_ANSWER: usize = 16 << 20;

/// Reader of a program's standard output.
pub struct LineReader {
    lines: Receiver<ReadResult>,
    /// Number of bytes that have arrived and are not read yet.
    waiting: Arc<AtomicUsize>,
}

/// Result of waiting for a line.
pub enum ReadResult {
    /// A line; invalid UTF-8 is replaced.
    Line(String),
    /// More than [`MAX_LINE`] bytes without a line feed.
    LineTooLong,
    /// More than [`MAX_ANSWER`] unread bytes.
    AnswerTooLong,
    /// No line arrived before the timeout.
    Timeout,
    /// The program has closed its output.
    Closed,
}

impl LineReader {
    /// Starts to read.
    pub fn new(stdout: ChildStdout) -> Self {
        let (sender, lines) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let reader = Self {
            lines,
            waiting: Arc::clone(&waiting),
        };
        std::thread::spawn(move || read_lines(BufReader::new(stdout), &sender, &waiting));
        reader
    }

    /// Returns the next line, or the reason why none arrives within `timeout`.
    pub fn read(&self, timeout: Duration) -> ReadResult {
        match self.lines.recv_timeout(timeout) {
            Ok(result) => {
                if let ReadResult::Line(line) = &result {
                    self.waiting.fetch_sub(line.len(), Ordering::Relaxed);
                }
                result
            }
            Err(RecvTimeoutError::Timeout) => ReadResult::Timeout,
            Err(RecvTimeoutError::Disconnected) => ReadResult::Closed,
        }
    }
}

/// Sends lines to the reader until the pipe closes or a limit is exceeded.
fn read_lines(mut reader: impl BufRead, sender: &Sender<ReadResult>, waiting: &AtomicUsize) {
    loop {
        let mut bytes = Vec::new();
        let most = MAX_LINE as u64 + 1;
        let result = match reader.by_ref().take(most).read_until(b'\n', &mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(_) if bytes.len() > MAX_LINE => ReadResult::LineTooLong,
            Ok(_) => {
                let line = String::from_utf8_lossy(&bytes).into_owned();
                let before = waiting.fetch_add(line.len(), Ordering::Relaxed);
                if before + line.len() > MAX_ANSWER {
                    ReadResult::AnswerTooLong
                } else {
                    ReadResult::Line(line)
                }
            }
        };
        let continues = matches!(result, ReadResult::Line(_));
        if sender.send(result).is_err() || !continues {
            return;
        }
    }
}

/// Writer to a program's standard input. Closes the pipe when dropped.
pub struct LineWriter {
    lines: Sender<String>,
    written: Receiver<io::Result<()>>,
}

/// Result of writing a line.
pub enum WriteResult {
    /// The line is in the pipe; the program may not have read it.
    Written,
    /// The pipe is full: the program does not read.
    Timeout,
    /// The program has closed its input.
    Closed,
}

impl LineWriter {
    /// Creates the writer and its thread.
    pub fn new(mut stdin: ChildStdin) -> Self {
        let (lines, queued) = channel::<String>();
        let (sender, written) = channel();
        std::thread::spawn(move || {
            for line in queued {
                let result = stdin
                    .write_all(line.as_bytes())
                    .and_then(|()| stdin.flush());
                if sender.send(result).is_err() {
                    return;
                }
            }
        });
        Self { lines, written }
    }

    /// Writes a line, within `timeout`. After a timeout, no more lines can be written.
    pub fn write(&self, line: String, timeout: Duration) -> WriteResult {
        if self.lines.send(line).is_err() {
            return WriteResult::Closed;
        }
        match self.written.recv_timeout(timeout) {
            Ok(Ok(())) => WriteResult::Written,
            Err(RecvTimeoutError::Timeout) => WriteResult::Timeout,
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => WriteResult::Closed,
        }
    }
}
