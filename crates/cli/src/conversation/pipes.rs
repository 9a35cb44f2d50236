//! The two pipes to a program, each with a thread of its own, because reading and writing block.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::process::{ChildStdin, ChildStdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// A line with more bytes is no message.
pub(crate) const LONGEST_LINE: usize = 1 << 20;

/// The limit on bytes that wait to be read, and on those in one answer.
pub(crate) const LONGEST_ANSWER: usize = 16 << 20;

/// The reader of a program's standard output.
pub(crate) struct Ears {
    lines: Receiver<Heard>,
    /// The number of bytes that have come and are not taken yet.
    waiting: Arc<AtomicUsize>,
}

/// The result of waiting for a line.
pub(crate) enum Heard {
    /// A line, without what is no UTF-8.
    Line(String),
    /// More than [`LONGEST_LINE`] bytes without a line feed.
    EndlessLine,
    /// More than [`LONGEST_ANSWER`] bytes without being asked.
    TooMuch,
    /// Nothing in time.
    Nothing,
    /// Nothing ever again.
    End,
}

impl Ears {
    pub(crate) fn new(stdout: ChildStdout) -> Self {
        let (sender, lines) = channel();
        let waiting = Arc::new(AtomicUsize::new(0));
        let ears = Self {
            lines,
            waiting: Arc::clone(&waiting),
        };
        std::thread::spawn(move || listen(BufReader::new(stdout), &sender, &waiting));
        ears
    }

    /// The next line, unless it takes longer than `patience`.
    pub(crate) fn hear(&self, patience: Duration) -> Heard {
        match self.lines.recv_timeout(patience) {
            Ok(heard) => {
                if let Heard::Line(line) = &heard {
                    self.waiting.fetch_sub(line.len(), Ordering::Relaxed);
                }
                heard
            }
            Err(RecvTimeoutError::Timeout) => Heard::Nothing,
            Err(RecvTimeoutError::Disconnected) => Heard::End,
        }
    }
}

/// Sends what comes until it ends, or is too much to keep.
fn listen(mut reader: impl BufRead, sender: &Sender<Heard>, waiting: &AtomicUsize) {
    loop {
        let mut bytes = Vec::new();
        let most = LONGEST_LINE as u64 + 1;
        let heard = match reader.by_ref().take(most).read_until(b'\n', &mut bytes) {
            Ok(0) | Err(_) => return,
            Ok(_) if bytes.len() > LONGEST_LINE => Heard::EndlessLine,
            Ok(_) => {
                let line = String::from_utf8_lossy(&bytes).into_owned();
                let before = waiting.fetch_add(line.len(), Ordering::Relaxed);
                if before + line.len() > LONGEST_ANSWER {
                    Heard::TooMuch
                } else {
                    Heard::Line(line)
                }
            }
        };
        let goes_on = matches!(heard, Heard::Line(_));
        if sender.send(heard).is_err() || !goes_on {
            return;
        }
    }
}

/// The writer to a program's standard input, which is closed when this is dropped.
pub(crate) struct Mouth {
    lines: Sender<String>,
    written: Receiver<io::Result<()>>,
}

/// The result of writing a line.
pub(crate) enum Told {
    /// It is written; whether the program has read it is not known.
    Yes,
    /// The pipe is full: the program does not read.
    NobodyReads,
    /// Nobody is there any more.
    End,
}

impl Mouth {
    pub(crate) fn new(mut stdin: ChildStdin) -> Self {
        let (lines, told) = channel::<String>();
        let (sender, written) = channel();
        std::thread::spawn(move || {
            for line in told {
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

    /// Writes a line, unless that takes longer than `patience`; then no more can be told.
    pub(crate) fn tell(&self, line: String, patience: Duration) -> Told {
        if self.lines.send(line).is_err() {
            return Told::End;
        }
        match self.written.recv_timeout(patience) {
            Ok(Ok(())) => Told::Yes,
            Err(RecvTimeoutError::Timeout) => Told::NobodyReads,
            Ok(Err(_)) | Err(RecvTimeoutError::Disconnected) => Told::End,
        }
    }
}
