//! Progress of a search or a run on standard error: one overwritten line on a terminal, or a new
//! line every few seconds elsewhere.

use std::io::{self, IsTerminal};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::output;
use elbowroom_executive::clock::Clock;

/// Minimum duration of a search with a progress line.
const DISPLAY_DELAY: Duration = Duration::from_millis(200);

/// Interval between frames of the spinner.
const FRAME_INTERVAL: Duration = Duration::from_millis(250);

/// Interval between lines if standard error is not a terminal.
const INTERVAL: Duration = Duration::from_secs(5);

/// Display of the last message, refreshed even without new ones.
pub(crate) struct Progress {
    is_terminal: bool,
    shown: Option<Shown>,
}

enum Shown {
    Overwritten(ProgressBar),
    Appended(Appended),
}

/// A thread that writes the last message regularly, until this is dropped.
struct Appended {
    message: Arc<Mutex<String>>,
    _until: Sender<()>,
}

impl Progress {
    /// Creates a display without a line.
    pub(crate) fn new() -> Self {
        Self {
            is_terminal: io::stderr().is_terminal(),
            shown: None,
        }
    }

    /// Shows a message if `elapsed` is long enough.
    pub(crate) fn show(&mut self, elapsed: Duration, message: impl FnOnce() -> String) {
        if self.is_terminal && elapsed < DISPLAY_DELAY {
            return;
        }
        let is_terminal = self.is_terminal;
        let shown = self.shown.get_or_insert_with(|| {
            if is_terminal {
                Shown::Overwritten(spinner())
            } else {
                Shown::Appended(Appended::new())
            }
        });
        match shown {
            Shown::Overwritten(line) => {
                line.set_message(message());
                line.tick();
            }
            Shown::Appended(lines) => lines.set_message(message()),
        }
    }

    /// Writes a permanent line above the progress line.
    pub(crate) fn print_above(&self, text: &str) {
        match &self.shown {
            Some(Shown::Overwritten(line)) => line.println(text),
            Some(Shown::Appended(_)) | None => output::print_to_stderr(text),
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(Shown::Overwritten(line)) = &self.shown {
            line.finish_and_clear();
        }
    }
}

fn spinner() -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} {elapsed}: {wide_msg}")
        .expect("a template without mistakes");
    let line = ProgressBar::new_spinner().with_style(style);
    // The spinner turns even if no new message comes.
    line.enable_steady_tick(FRAME_INTERVAL);
    line
}

impl Appended {
    fn new() -> Self {
        let message = Arc::new(Mutex::new(String::new()));
        let (until, ended) = mpsc::channel();
        let last = Arc::clone(&message);
        let clock = Clock::start();
        // If no thread is available, no progress is shown.
        let _ = thread::Builder::new().spawn(move || {
            while ended.recv_timeout(INTERVAL) == Err(RecvTimeoutError::Timeout) {
                let last = last.lock().unwrap_or_else(PoisonError::into_inner).clone();
                output::print_to_stderr(&format!("{} s: {last}", clock.elapsed().as_secs()));
            }
        });
        Self {
            message,
            _until: until,
        }
    }

    fn set_message(&mut self, message: String) {
        *self.message.lock().unwrap_or_else(PoisonError::into_inner) = message;
    }
}
