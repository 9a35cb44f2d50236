//! Slack of running actions: warnings before it is used up.

use elbowroom_num::Rational;

use super::Run;
use crate::event::Ticket;
use crate::executor::{CAN_HAVE_A_CLOCK, StepId};
use crate::record::{Entry, WarningCause};

/// A running action that may become late, with its latest tolerable end.
struct Late {
    ticket: Ticket,
    step: StepId,
    action: String,
    /// The end of its present window.
    window: Rational,
    /// `true` if it was computed whether the plan tolerates a later end.
    is_known: bool,
    /// The time of the warning.
    warn: Rational,
    /// The latest tolerable end, after which a new plan is needed.
    until: Rational,
}

impl Run<'_> {
    /// Warns of actions that are about to use up their slack. The warning comes when a quarter of
    /// the time between the planned end and the latest tolerable end is left, or twice the expected
    /// planning time if that is longer. Returns the time of the next check.
    pub(super) fn warn(&mut self) -> Option<Rational> {
        if !CAN_HAVE_A_CLOCK || !self.settings.watches_room {
            return None;
        }
        let (due, later): (Vec<Late>, Vec<Late>) =
            self.late().partition(|late| late.warn <= self.now);
        let mut again: Vec<Rational> = later.into_iter().map(|late| late.warn).collect();
        let mut next: Option<Rational> = None;
        for late in due {
            let Some(late) = self.looked_into(late) else {
                continue;
            };
            if late.warn > self.now {
                again.push(late.warn);
                continue;
            }
            self.account.note_warning(late.ticket, &late.until);
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
            self.foresee(&until);
        }
        again.into_iter().min()
    }

    /// Returns the same with the latest tolerable end, which may be later than the end of the
    /// present window. `None` if there was a warning of it.
    fn looked_into(&mut self, late: Late) -> Option<Late> {
        if late.is_known {
            return Some(late);
        }
        let later = self.ports.executor.bears_until(late.step, &self.now);
        let until = later.into_iter().fold(late.window.clone(), Rational::max);
        self.account.note_bearable(late.ticket, late.window, until);
        self.late_at(late.ticket)
    }

    /// Returns the time that is reserved between the need for a new plan and its start, if it is
    /// made in advance.
    pub(super) fn margin(&self) -> Rational {
        self.allowance.clone().max(Rational::new(1, 4))
    }

    /// Returns the actions that may use up their slack, without those for which there was a
    /// warning.
    fn late(&self) -> impl Iterator<Item = Late> + '_ {
        let open = self.account.open_tickets();
        open.filter_map(|ticket| self.late_at(ticket))
    }

    fn late_at(&self, ticket: Ticket) -> Option<Late> {
        let entry = self.account.get(ticket)?;
        let step = entry.step?;
        let window = self.ports.executor.window(step, true)?.latest?;
        let bearable = entry.bearable.as_ref();
        let bearable = bearable.filter(|(known, _)| *known == window);
        let until = bearable.map_or(&window, |(_, until)| until).clone();
        if entry.warned.as_ref() == Some(&until) || until < self.now {
            return None;
        }
        let began = entry.started.as_ref().unwrap_or(&entry.ordered);
        let planned = began + entry.planned.as_ref()?;
        let quarter = (&until - &planned) * Rational::new(1, 4);
        let ahead = quarter.max(&self.allowance * Rational::from(2));
        Some(Late {
            ticket,
            step,
            action: entry.action.name.clone(),
            is_known: bearable.is_some(),
            window,
            warn: (&until - ahead).max(planned),
            until,
        })
    }

    /// Returns the overdue actions: those that have run for longer than planned and have not been
    /// cancelled.
    pub(super) fn overdue(&self) -> Vec<Ticket> {
        let mut overdue = self.longer_than_planned();
        overdue.retain(|ticket| !self.account.is_cancelled(*ticket));
        overdue
    }

    /// Returns the actions that have run for longer than planned.
    pub(super) fn longer_than_planned(&self) -> Vec<Ticket> {
        let running = self.belief.running().iter();
        let overdue =
            running.filter(|(_, underway)| &self.now - &underway.start >= underway.planned);
        overdue.map(|(ticket, _)| *ticket).collect()
    }
}
