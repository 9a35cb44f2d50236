//! Warnings of late actions, and the cancellation of actions that time out.

use std::sync::Arc;

use elbowroom_num::Rational;

use super::Run;
use super::agenda::PendingStep;
use super::history::BelievedEventKind;
use super::view::{ActionTimeout, LateAction};
use crate::event::{ActionHandle, Ending};
use crate::executor::PlanEvent;
use crate::record::{Entry, WarningCause};

impl Run<'_> {
    /// Warns of approaching time-outs, and cancels the actions that have reached theirs.
    pub(super) fn check_timeouts(&mut self) {
        let limits: Vec<ActionTimeout> = self.view().action_timeouts().collect();
        let (expired, running): (Vec<_>, Vec<_>) =
            limits.into_iter().partition(|limit| limit.until < self.now);
        let is_due =
            |limit: &&ActionTimeout| limit.warn.as_ref().is_some_and(|warn| *warn <= self.now);
        for limit in running.iter().filter(is_due) {
            let Some(entry) = self.action_log.get(limit.ticket) else {
                continue;
            };
            self.ports.recorder.record(&Entry::Warning {
                now: &self.now,
                ticket: limit.ticket,
                action: &entry.action.name,
                until: &limit.until,
                cause: WarningCause::Timeout,
            });
            self.action_log
                .note_timeout_warning(limit.ticket, &limit.until);
        }
        let expired = expired.into_iter().rev();
        let expired = expired.map(|limit| PendingStep::TimeOut(limit.ticket, limit.until));
        self.agenda.extend(expired);
    }

    /// Cancels an action that has reached its time-out. If it was cancelled before and has not
    /// ended, it counts as failed, and its end effects are in doubt.
    pub(super) fn time_out(&mut self, ticket: ActionHandle, since: Rational) {
        let Some(entry) = self.action_log.get(ticket) else {
            return;
        };
        if entry.cancelled.is_none() {
            self.action_log.note_timeout(ticket, &since);
            self.cancel(vec![ticket]);
            return;
        }
        let since = entry.timed_out.clone().unwrap_or(since);
        let (action, has_started) = (Arc::clone(&entry.action), entry.started.is_some());
        self.belief.stop(ticket);
        self.background.note_unexpected_effects();
        let now = self.now.clone();
        self.record_believed_event(&now, BelievedEventKind::Stopped(ticket));
        self.doubt(ticket, &action, has_started);
        self.action_log.note_doubt(ticket, true);
        self.end_timed_out(ticket, &now, since);
    }

    /// Ends an action that has timed out: it has ended without its effects, or counts as ended.
    pub(super) fn end_timed_out(&mut self, ticket: ActionHandle, time: &Rational, since: Rational) {
        let entry = self.action_log.get(ticket);
        let Some((action, step)) = entry.map(|entry| (entry.action.name.clone(), entry.step))
        else {
            return;
        };
        let why = "it timed out".to_owned();
        self.action_log
            .note_end(ticket, time, &Ending::Failed { why }, &[]);
        if step.is_some() {
            self.plan_events.push(PlanEvent::TimedOut { action, since });
        }
    }

    /// Warns of actions that are about to use up their slack. The warning comes when a quarter of
    /// the time between the planned end and the latest tolerable end is left, or twice the expected
    /// planning time if that is longer. Returns the time of the next check.
    pub(super) fn warn_of_late_actions(&mut self) -> Option<Rational> {
        if !self.settings.monitors_slack {
            return None;
        }
        let (due, later): (Vec<LateAction>, Vec<LateAction>) = self
            .view()
            .late_actions()
            .partition(|late| late.warn <= self.now);
        let mut again: Vec<Rational> = later.into_iter().map(|late| late.warn).collect();
        let mut next: Option<Rational> = None;
        for late in due {
            let Some(late) = self.with_computed_tolerance(late) else {
                continue;
            };
            if late.warn > self.now {
                again.push(late.warn);
                continue;
            }
            self.action_log.note_warning(late.ticket, &late.until);
            self.ports.recorder.record(&Entry::Warning {
                now: &self.now,
                ticket: late.ticket,
                action: &late.action,
                until: &late.until,
                cause: WarningCause::Slack,
            });
            next = next.into_iter().chain([late.until]).min();
        }
        if let Some(until) = next {
            self.announce_expected_situation(&until);
        }
        again.into_iter().min()
    }

    /// Returns the same with the latest tolerable end, which may be later than the end of the
    /// present window. `None` if there was a warning of it.
    fn with_computed_tolerance(&mut self, late: LateAction) -> Option<LateAction> {
        if late.is_tolerance_computed {
            return Some(late);
        }
        let later = self
            .ports
            .executor
            .latest_tolerated_end(late.step, &self.now);
        let until = later
            .into_iter()
            .fold(late.window_end.clone(), Rational::max);
        self.action_log
            .record_latest_tolerable_end(late.ticket, late.window_end, until);
        self.view().late_action(late.ticket)
    }
}
