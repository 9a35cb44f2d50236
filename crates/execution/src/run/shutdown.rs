//! End of a run: cancels running actions and waits for them to stop.

use elbowroom_num::Rational;

use super::work_queue::PendingStep;
use super::{Next, Report, Run, Stop, Verdict};
use crate::event::ActionHandle;
use crate::executor::PlanEvent;
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;

/// Time that cancelled actions have to stop at the end of a run, in seconds of the world's clock.
pub const SHUTDOWN_GRACE: i64 = 5;

/// The closing phase of a run, while running actions are cancelled.
pub(super) struct Shutdown {
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
    pub(super) fn check_stop_request(&mut self) -> Result<(), Stop> {
        if !(self.stop_check)() {
            return Ok(());
        }
        self.ports
            .recorder
            .record(&Entry::Interrupted { now: &self.now });
        Err(Stop::Ended(Verdict::Interrupted))
    }

    /// Ends the run: cancels the running actions, and waits for their ends. A world that cannot be
    /// reached ([`WorldError::is_reachable`](crate::WorldError)) receives no commands. If the world
    /// fails meanwhile, the wait ends, and the verdict is not changed.
    pub(super) fn begin_shutdown(&mut self, stop: Stop) {
        self.work_queue.clear();
        self.plan_events.clear();
        self.cancel_search();
        if self.shutdown.is_some() {
            self.conclude();
            return;
        }
        let mut has_left = false;
        let verdict = match stop {
            Stop::Ended(verdict) if self.becomes_idle_after(&verdict) => {
                self.become_idle(&verdict);
                return;
            }
            Stop::Ended(verdict) => verdict,
            Stop::WorldFailed(error) => {
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
        self.shutdown = Some(Shutdown {
            verdict,
            dead_end,
            last: &self.now + Rational::from(SHUTDOWN_GRACE),
            has_answered: false,
        });
        let open: Vec<ActionHandle> = self.action_log.open_tickets().collect();
        if has_left || open.is_empty() {
            self.conclude();
            return;
        }
        self.clock_watchdog.begin_plan();
        // Immediate ends are reported at once.
        self.work_queue
            .push(PendingStep::ShutDown(self.now.clone()));
        let running = open.into_iter();
        let running = running.filter(|ticket| !self.action_log.is_cancelled(*ticket));
        self.work_queue.push(PendingStep::Cancel(running.collect()));
    }

    /// Waits for the cancelled actions that have not stopped, or ends the run if there are none.
    pub(super) fn continue_shutdown_until(&mut self, until: Rational) {
        if self.action_log.open_tickets().next().is_some() {
            self.open_request = Some(Next::Wait { until });
        } else {
            self.conclude();
        }
    }

    /// Continues after the world's answer to [`Self::close`].
    pub(super) fn continue_shutdown(&mut self) {
        let moves_on = self.clock_watchdog.count_answer(&self.now, self.steps);
        if let Some(closing) = &mut self.shutdown
            && !std::mem::replace(&mut closing.has_answered, true)
        {
            closing.last = &self.now + Rational::from(SHUTDOWN_GRACE);
        }
        match &self.shutdown {
            Some(closing) if self.now < closing.last && moves_on.is_ok() => {
                let last = closing.last.clone();
                self.work_queue.push(PendingStep::ShutDown(last));
            }
            _ => self.conclude(),
        }
    }

    /// Returns `true` if the verdict was that no plan is known, and facts or numbers have changed
    /// since.
    fn is_verdict_outdated(&self, verdict: &Verdict) -> bool {
        let is_change = |news: &PlanEvent| matches!(news, PlanEvent::Fact(_) | PlanEvent::Value(_));
        matches!(verdict, Verdict::Unsolvable | Verdict::NoPlan { .. })
            && self.plan_events.iter().any(is_change)
    }

    /// Ends the run, or requests another plan if facts or numbers have changed since the verdict.
    fn conclude(&mut self) {
        let Some(Shutdown {
            verdict, dead_end, ..
        }) = self.shutdown.take()
        else {
            return;
        };
        if self.is_verdict_outdated(&verdict) {
            let reason = Reason::new(Cause::Surprise).about(Subject::AnyObservation);
            self.work_queue = vec![PendingStep::Replan(reason)];
            return;
        }
        let report = Report {
            verdict,
            time: self.now.clone(),
            replans: self.replans,
            reasons: std::mem::take(&mut self.reasons),
            dead_end,
            starts: self.action_log.started(),
            executed: self.action_log.executed(&self.now),
        };
        self.ports.recorder.record(&Entry::Over(&report));
        self.report = Some(report);
    }

    /// Continues a run that was over with a new plan from there, if that is permitted. Returns
    /// `true` if it does.
    pub(super) fn reopen(&mut self) -> bool {
        let Some(left) = self.restarts_left.checked_sub(1) else {
            return false;
        };
        self.restarts_left = left;
        self.report = None;
        self.work_queue = vec![PendingStep::Replan(Reason::new(Cause::NewPlan))];
        true
    }
}

impl<'a> Run<'a> {
    /// Makes the run continue up to `times` times after it was over without its goal
    /// ([`Verdict::NoPlan`], [`Verdict::PlannerFailed`]): another plan is searched for, from the
    /// situation at its end. [`Run::go`] does that by itself.
    #[must_use]
    pub fn with_restarts(self, times: usize) -> Run<'a> {
        Self {
            restarts_left: times,
            ..self
        }
    }
}
