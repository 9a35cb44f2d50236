//! End of a run: the verdict while running actions are cancelled, and the report.

use elbowroom_num::Rational;

use super::settings::{Report, Verdict};
use crate::reason::Reason;

/// Time that cancelled actions have to stop at the end of a run, in seconds of the world's clock.
pub const SHUTDOWN_GRACE: i64 = 5;

/// The end of a run.
pub(super) struct Closing<'a> {
    /// Returns `true` if the run is to end.
    stop_check: Box<dyn Fn() -> bool + Send + 'a>,
    /// The closing phase, while running actions are cancelled.
    shutdown: Option<Shutdown>,
    /// The report, once the run is over.
    report: Option<Report>,
    /// Number of times that the run may be continued after its end.
    restarts_left: usize,
}

/// The closing phase of a run.
struct Shutdown {
    verdict: Verdict,
    dead_end: Vec<Reason>,
    /// Time at which the run ends at the latest.
    last: Rational,
    /// `true` once the world has reported its time. After an interrupted wait, the clock of the run
    /// may be behind.
    has_answered: bool,
}

impl<'a> Closing<'a> {
    /// Creates the end of a run that is not requested.
    pub(super) fn new() -> Self {
        Self {
            stop_check: Box::new(|| false),
            shutdown: None,
            report: None,
            restarts_left: 0,
        }
    }

    pub(super) fn set_stop_check(&mut self, must_end: impl Fn() -> bool + Send + 'a) {
        self.stop_check = Box::new(must_end);
    }

    pub(super) fn set_restarts(&mut self, times: usize) {
        self.restarts_left = times;
    }

    pub(super) fn is_stop_requested(&self) -> bool {
        (self.stop_check)()
    }

    pub(super) fn is_shutting_down(&self) -> bool {
        self.shutdown.is_some()
    }

    /// Begins to cancel the running actions.
    pub(super) fn begin(&mut self, verdict: Verdict, dead_end: Vec<Reason>, now: &Rational) {
        self.shutdown = Some(Shutdown {
            verdict,
            dead_end,
            last: now + Rational::from(SHUTDOWN_GRACE),
            has_answered: false,
        });
    }

    /// Records an answer of the world. Returns the time until when the run waits for the cancelled
    /// actions, if it has not come.
    pub(super) fn note_answer(&mut self, now: &Rational) -> Option<Rational> {
        let shutdown = self.shutdown.as_mut()?;
        if !std::mem::replace(&mut shutdown.has_answered, true) {
            shutdown.last = now + Rational::from(SHUTDOWN_GRACE);
        }
        (*now < shutdown.last).then(|| shutdown.last.clone())
    }

    /// Ends the closing phase. Returns the verdict, and the explanation of a dead end.
    pub(super) fn end(&mut self) -> Option<(Verdict, Vec<Reason>)> {
        let shutdown = self.shutdown.take()?;
        Some((shutdown.verdict, shutdown.dead_end))
    }

    pub(super) fn finish(&mut self, report: Report) {
        self.report = Some(report);
    }

    pub(super) fn report(&self) -> Option<&Report> {
        self.report.as_ref()
    }

    /// Continues a run that is over, if that is permitted. Returns `true` if it does.
    pub(super) fn reopen(&mut self) -> bool {
        let Some(left) = self.restarts_left.checked_sub(1) else {
            return false;
        };
        self.restarts_left = left;
        self.report = None;
        true
    }
}
