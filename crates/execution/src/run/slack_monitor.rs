//! Slack of running actions: warnings before it is used up.

use elbowroom_num::Rational;

use super::Run;
use crate::event::ActionHandle;
use crate::executor::StepId;
use crate::record::{Entry, WarningCause};

/// A running action that may become late, with its latest tolerable end.
struct LateAction {
    ticket: ActionHandle,
    step: StepId,
    action: String,
    /// The end of its present window.
    window_end: Rational,
    /// `true` if it was computed whether the plan tolerates a later end.
    is_tolerance_computed: bool,
    /// The time of the warning.
    warn: Rational,
    /// The latest tolerable end, after which a new plan is needed.
    until: Rational,
}

impl Run<'_> {
    /// Warns of actions that are about to use up their slack. The warning comes when a quarter of
    /// the time between the planned end and the latest tolerable end is left, or twice the expected
    /// planning time if that is longer. Returns the time of the next check.
    pub(super) fn warn_of_late_actions(&mut self) -> Option<Rational> {
        if !self.settings.monitors_slack {
            return None;
        }
        let (due, later): (Vec<LateAction>, Vec<LateAction>) =
            self.late_actions().partition(|late| late.warn <= self.now);
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
        let later = self.ports.executor.bears_until(late.step, &self.now);
        let until = later
            .into_iter()
            .fold(late.window_end.clone(), Rational::max);
        self.action_log
            .record_latest_tolerable_end(late.ticket, late.window_end, until);
        self.late_action(late.ticket)
    }

    /// Returns the time that is reserved between the need for a new plan and its start, if it is
    /// made in advance.
    pub(super) fn replanning_margin(&self) -> Rational {
        self.expected_planning_time.clone().max(Rational::new(1, 4))
    }

    /// Returns the actions that may use up their slack, without those for which there was a
    /// warning.
    fn late_actions(&self) -> impl Iterator<Item = LateAction> + '_ {
        let open = self.action_log.open_tickets();
        open.filter_map(|ticket| self.late_action(ticket))
    }

    fn late_action(&self, ticket: ActionHandle) -> Option<LateAction> {
        let entry = self.action_log.get(ticket)?;
        let step = entry.step?;
        let window = self.ports.executor.window(step, true)?.latest?;
        let bearable = entry.latest_tolerable_end.as_ref();
        let bearable = bearable.filter(|(known, _)| *known == window);
        let until = bearable.map_or(&window, |(_, until)| until).clone();
        if entry.warned.as_ref() == Some(&until) || until < self.now {
            return None;
        }
        let began = entry.started.as_ref().unwrap_or(&entry.commanded);
        let planned = began + entry.planned.as_ref()?;
        let quarter = (&until - &planned) * Rational::new(1, 4);
        let ahead = quarter.max(&self.expected_planning_time * Rational::from(2));
        Some(LateAction {
            ticket,
            step,
            action: entry.action.name.clone(),
            is_tolerance_computed: bearable.is_some(),
            window_end: window,
            warn: (&until - ahead).max(planned),
            until,
        })
    }

    /// Returns the overdue actions: those that have run for longer than planned and have not been
    /// cancelled.
    pub(super) fn overdue(&self) -> Vec<ActionHandle> {
        let mut overdue = self.longer_than_planned();
        overdue.retain(|ticket| !self.action_log.is_cancelled(*ticket));
        overdue
    }

    /// Returns the actions that have run for longer than planned.
    pub(super) fn longer_than_planned(&self) -> Vec<ActionHandle> {
        let running = self.belief.running().iter();
        let overdue =
            running.filter(|(_, underway)| &self.now - &underway.start >= underway.planned);
        overdue.map(|(ticket, _)| *ticket).collect()
    }
}
