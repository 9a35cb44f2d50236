//! End of a run: cancels running actions and waits for them to stop.

use elbowroom_model::ground::Condition;
use elbowroom_num::Rational;

use super::agenda::{Next, PendingStep};
use super::settings::{Report, Verdict};
use super::{Run, Stop};
use crate::event::ActionHandle;
use crate::executor::PlanEvent;
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;

impl Run<'_> {
    /// Ends the run if that was requested.
    pub(super) fn check_stop_request(&mut self) -> Result<(), Stop> {
        if !self.closing.is_stop_requested() {
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
        self.agenda.clear();
        self.plan_events.clear();
        self.cancel_search();
        if self.closing.is_shutting_down() {
            self.conclude();
            return;
        }
        let mut has_left = false;
        let verdict = match stop {
            Stop::Ended(verdict) if self.goals.becomes_idle_after(&verdict) => {
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
            Verdict::Unsolvable if self.history.is_explaining() => {
                self.dead_end(self.unreachable_parts())
            }
            _ => Vec::new(),
        };
        self.closing.begin(verdict, dead_end, &self.now);
        let open: Vec<ActionHandle> = self.action_log.open_tickets().collect();
        if has_left || open.is_empty() {
            self.conclude();
            return;
        }
        self.clock_watchdog.begin_plan();
        // Immediate ends are reported at once.
        self.agenda.push(PendingStep::ShutDown(self.now.clone()));
        let running = open.into_iter();
        let running = running.filter(|ticket| !self.action_log.is_cancelled(*ticket));
        self.agenda.push(PendingStep::Cancel(running.collect()));
    }

    /// Waits for the cancelled actions that have not stopped, or ends the run if there are none.
    pub(super) fn continue_shutdown_until(&mut self, until: Rational) {
        if self.action_log.open_tickets().next().is_some() {
            self.agenda.ask(Next::Wait { until });
        } else {
            self.conclude();
        }
    }

    /// Continues after the world's answer to [`Self::close`].
    pub(super) fn continue_shutdown(&mut self) {
        let moves_on = self.clock_watchdog.count_answer(&self.now, self.steps);
        match self.closing.note_answer(&self.now) {
            Some(last) if moves_on.is_ok() => self.agenda.push(PendingStep::ShutDown(last)),
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

    /// Returns the parts of the goal that can never become true again, and since when, as far as
    /// that can be computed.
    pub(super) fn unreachable_parts(&self) -> Option<Vec<(Condition, Reason)>> {
        let log = &self.action_log;
        self.history
            .explain_unreachable_parts(&self.belief, log, &self.now)
    }

    /// Returns the reasons for which no plan reaches the goal, from its unreachable parts. Without
    /// such a part, names the conditions that exclude each other.
    pub(super) fn dead_end(&self, parts: Option<Vec<(Condition, Reason)>>) -> Vec<Reason> {
        match parts {
            None => Vec::new(),
            Some(parts) if !parts.is_empty() => parts.into_iter().map(|it| it.1).collect(),
            Some(_) => {
                let conflict = self.goals.first_conflict(&self.task);
                let reason = conflict.map(|it| it.reason());
                vec![reason.unwrap_or_else(|| Reason::new(Cause::NotTogether))]
            }
        }
    }

    /// Ends the run, or requests another plan if facts or numbers have changed since the verdict.
    fn conclude(&mut self) {
        let Some((verdict, dead_end)) = self.closing.end() else {
            return;
        };
        if self.is_verdict_outdated(&verdict) {
            let reason = Reason::new(Cause::Surprise).about(Subject::AnyObservation);
            self.agenda.restart_with(PendingStep::Replan(reason));
            return;
        }
        let report = Report {
            verdict,
            time: self.now.clone(),
            replans: self.replans.count(),
            reasons: self.replans.take_reasons(),
            dead_end,
            starts: self.action_log.started(),
            executed: self.action_log.executed(&self.now),
        };
        self.ports.recorder.record(&Entry::Over(&report));
        self.closing.finish(report);
    }

    /// Continues a run that was over with a new plan from there, if that is permitted. Returns
    /// `true` if it does.
    pub(super) fn reopen(&mut self) -> bool {
        let is_permitted = self.closing.reopen();
        if is_permitted {
            let reason = Reason::new(Cause::NewPlan);
            self.agenda.restart_with(PendingStep::Replan(reason));
        }
        is_permitted
    }
}
