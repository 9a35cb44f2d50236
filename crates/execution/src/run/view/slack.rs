//! Slack of running actions.

use elbowroom_num::Rational;

use super::RunView;
use crate::event::ActionHandle;
use crate::executor::StepId;

/// A running action that may become late, with its latest tolerable end.
pub(in crate::run) struct LateAction {
    pub(in crate::run) ticket: ActionHandle,
    pub(in crate::run) step: StepId,
    pub(in crate::run) action: String,
    /// The end of its present window.
    pub(in crate::run) window_end: Rational,
    /// `true` if it was computed whether the plan tolerates a later end.
    pub(in crate::run) is_tolerance_computed: bool,
    /// The time of the warning.
    pub(in crate::run) warn: Rational,
    /// The latest tolerable end, after which a new plan is needed.
    pub(in crate::run) until: Rational,
}

impl RunView<'_> {
    /// Returns the time that is reserved between the need for a new plan and its start, if it is
    /// made in advance.
    pub(in crate::run) fn replanning_margin(&self) -> Rational {
        self.expected_planning_time.clone().max(Rational::new(1, 4))
    }

    /// Returns the actions that may use up their slack, without those for which there was a
    /// warning.
    pub(in crate::run) fn late_actions(&self) -> impl Iterator<Item = LateAction> + '_ {
        let open = self.log.open_tickets();
        open.filter_map(|ticket| self.late_action(ticket))
    }

    pub(in crate::run) fn late_action(&self, ticket: ActionHandle) -> Option<LateAction> {
        let entry = self.log.get(ticket)?;
        let step = entry.step?;
        let window = self.executor.window(step, true)?.latest?;
        let bearable = entry.latest_tolerable_end.as_ref();
        let bearable = bearable.filter(|(known, _)| *known == window);
        let until = bearable.map_or(&window, |(_, until)| until).clone();
        if entry.warned.as_ref() == Some(&until) || until < *self.now {
            return None;
        }
        let began = entry.started.as_ref().unwrap_or(&entry.commanded);
        let planned = began + entry.planned.as_ref()?;
        let quarter = (&until - &planned) * Rational::new(1, 4);
        let ahead = quarter.max(self.expected_planning_time * Rational::from(2));
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
    pub(in crate::run) fn overdue(&self) -> Vec<ActionHandle> {
        let mut overdue = self.longer_than_planned();
        overdue.retain(|ticket| !self.log.is_cancelled(*ticket));
        overdue
    }

    /// Returns the actions that have run for longer than planned.
    pub(in crate::run) fn longer_than_planned(&self) -> Vec<ActionHandle> {
        let running = self.belief.running().iter();
        let overdue =
            running.filter(|(_, underway)| self.now - &underway.start >= underway.planned);
        overdue.map(|(ticket, _)| *ticket).collect()
    }
}
