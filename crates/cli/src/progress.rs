//! The line that shows how a search is getting on: on a terminal only, nothing in a pipe.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Searches that end sooner than this show no line at all.
const PATIENCE: Duration = Duration::from_millis(200);

/// How often the line turns.
const TURN: Duration = Duration::from_millis(250);

/// A line on standard error that overwrites itself and vanishes at the end.
pub(crate) struct Progress {
    line: Option<ProgressBar>,
}

impl Progress {
    /// No line yet.
    pub(crate) fn new() -> Self {
        Self { line: None }
    }

    /// Shows how far the search has come.
    pub(crate) fn show(&mut self, elapsed: Duration, message: impl FnOnce() -> String) {
        if elapsed < PATIENCE {
            return;
        }
        let line = self.line.get_or_insert_with(|| {
            let style = ProgressStyle::with_template("{spinner} {wide_msg}")
                .expect("a template without mistakes");
            let line = ProgressBar::new_spinner().with_style(style);
            // It turns also while nothing new is told.
            line.enable_steady_tick(TURN);
            line
        });
        line.set_message(message());
        line.tick();
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if let Some(line) = &self.line {
            line.finish_and_clear();
        }
    }
}
