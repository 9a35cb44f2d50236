//! End of a run: cancels running actions and waits for them to stop.

use elbowroom_num::Rational;

use super::agenda::Todo;
use super::{Next, Report, Run, Stop, Verdict};
use crate::event::Ticket;
use crate::executor::News;
use crate::reason::{About, Cause, Reason};
use crate::record::Entry;

/// Time that cancelled actions have to stop at the end of a run, in seconds of the world's clock.
pub const FAREWELL: i64 = 5;

/// The closing phase of a run, while running actions are cancelled.
pub(super) struct Closing {
    verdict: Verdict,
    dead_end: Vec<Reason>,
    /// Time at which the run ends at the latest.
    last: Rational,
    /// `true` once the world has reported its time. After an interrupted wait, the clock of the run
    /// may be behind.
    has_answered: bool,
}

impl Run<'_> {
    /// Ends the run if that was requested.
    pub(super) fn heed(&mut self) -> Result<(), Stop> {
        if !(self.is_to_end)() {
            return Ok(());
        }
        self.ports
            .recorder
            .record(&Entry::Interrupted { now: &self.now });
        Err(Stop::Over(Verdict::Interrupted))
    }

    /// Ends the run: cancels the running actions, and waits for their ends. A world that cannot be
    /// reached ([`WorldError::is_reachable`](crate::WorldError)) receives no commands. If the world
    /// fails meanwhile, the wait ends, and the verdict is not changed.
    pub(super) fn stop(&mut self, stop: Stop) {
        self.agenda.clear();
        self.news.clear();
        self.give_up_search();
        if self.closing.is_some() {
            self.conclude();
            return;
        }
        let mut has_left = false;
        let verdict = match stop {
            Stop::Over(verdict) if self.goes_on_after(&verdict) => {
                self.rest(&verdict);
                return;
            }
            Stop::Over(verdict) => verdict,
            Stop::World(error) => {
                has_left = !error.is_reachable;
                if error.is_reachable {
                    self.ports.recorder.record(&Entry::WorldFailed {
                        now: &self.now,
                        why: &error.message,
                    });
                }
                Verdict::WorldFailed { why: error.message }
            }
        };
        let dead_end = match verdict {
            Verdict::Unsolvable if self.is_explaining => self.dead_end(),
            _ => Vec::new(),
        };
        self.closing = Some(Closing {
            verdict,
            dead_end,
            last: &self.now + Rational::from(FAREWELL),
            has_answered: false,
        });
        let open: Vec<Ticket> = self.account.open_tickets().collect();
        if has_left || open.is_empty() {
            self.conclude();
            return;
        }
        self.progress.begin_plan();
        // Immediate ends are reported at once.
        self.agenda.push(Todo::Close(self.now.clone()));
        let running = open.into_iter();
        let running = running.filter(|ticket| !self.account.is_cancelled(*ticket));
        self.agenda.push(Todo::Cancel(running.collect()));
    }

    /// Waits for the cancelled actions that have not stopped, or ends the run if there are none.
    pub(super) fn close(&mut self, until: Rational) {
        if self.account.open_tickets().next().is_some() {
            self.asked = Some(Next::Wait { until });
        } else {
            self.conclude();
        }
    }

    /// Continues after the world's answer to [`Self::close`].
    pub(super) fn go_on_closing(&mut self) {
        let moves_on = self.progress.note(&self.now, self.steps);
        if let Some(closing) = &mut self.closing
            && !std::mem::replace(&mut closing.has_answered, true)
        {
            closing.last = &self.now + Rational::from(FAREWELL);
        }
        match &self.closing {
            Some(closing) if self.now < closing.last && moves_on.is_ok() => {
                let last = closing.last.clone();
                self.agenda.push(Todo::Close(last));
            }
            _ => self.conclude(),
        }
    }

    /// Returns `true` if the verdict was that no plan is known, and facts or numbers have changed
    /// since.
    fn is_verdict_outdated(&self, verdict: &Verdict) -> bool {
        let is_change = |news: &News| matches!(news, News::Fact(_) | News::Value(_));
        matches!(verdict, Verdict::Unsolvable | Verdict::NoPlan { .. })
            && self.news.iter().any(is_change)
    }

    /// Ends the run, or requests another plan if facts or numbers have changed since the verdict.
    fn conclude(&mut self) {
        let Some(Closing {
            verdict, dead_end, ..
        }) = self.closing.take()
        else {
            return;
        };
        if self.is_verdict_outdated(&verdict) {
            let reason = Reason::new(Cause::Surprise).about(About::AnyObservation);
            self.agenda = vec![Todo::Replan(reason)];
            return;
        }
        let report = Report {
            verdict,
            time: self.now.clone(),
            replans: self.replans,
            reasons: std::mem::take(&mut self.reasons),
            dead_end,
            starts: self.account.started(),
            executed: self.account.executed(&self.now),
        };
        self.ports.recorder.record(&Entry::Over(&report));
        self.report = Some(report);
    }

    /// Continues a run that was over with a new plan from there, if that is permitted. Returns
    /// `true` if it does.
    pub(super) fn reopen(&mut self) -> bool {
        let Some(left) = self.reopenings.checked_sub(1) else {
            return false;
        };
        self.reopenings = left;
        self.report = None;
        self.agenda = vec![Todo::Replan(Reason::new(Cause::NewPlan))];
        true
    }
}

impl<'a> Run<'a> {
    /// Makes the run continue up to `times` times after it was over without its goal
    /// ([`Verdict::NoPlan`], [`Verdict::PlannerFailed`]): another plan is searched for, from the
    /// situation at its end. [`Run::go`] does that by itself.
    #[must_use]
    pub fn reopened(self, times: usize) -> Run<'a> {
        Self {
            reopenings: times,
            ..self
        }
    }
}
