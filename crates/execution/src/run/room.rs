//! How much longer what is under way may take, and what is done when that is used up.

use elbowroom_num::Rational;

use super::Run;
use crate::event::Ticket;
use crate::record::Entry;

/// What is under way and late, and until when the plan can bear it.
struct Late {
    ticket: Ticket,
    action: String,
    /// When to warn of it.
    warn: Rational,
    /// From then on a new plan is needed.
    until: Rational,
}

impl Run<'_> {
    /// Warns of what has used its room: when a quarter of the time is left between its planned end and
    /// the last moment that the plan can bear, or twice as long as planning is expected to take, if
    /// that is longer. Returns when to look again.
    pub(super) fn warn(&mut self) -> Option<Rational> {
        if !self.settings.watches_room {
            return None;
        }
        let (due, later): (Vec<Late>, Vec<Late>) =
            self.late().partition(|late| late.warn <= self.now);
        let next = due.iter().map(|late| late.until.clone()).min();
        for late in due {
            self.account.note_warning(late.ticket, &late.until);
            self.ports.recorder.record(&Entry::Warning {
                now: &self.now,
                ticket: late.ticket,
                action: &late.action,
                until: &late.until,
            });
        }
        if let Some(until) = next {
            self.foresee(&until);
        }
        later.into_iter().map(|late| late.warn).min()
    }

    /// The time between the moment from which on a new plan is needed and its beginning, if it is
    /// made ahead.
    pub(super) fn margin(&self) -> Rational {
        self.allowance.clone().max(Rational::new(1, 4))
    }

    /// What may come to use its room, and was not warned of.
    fn late(&self) -> impl Iterator<Item = Late> + '_ {
        self.account.open_tickets().filter_map(|ticket| {
            let entry = self.account.get(ticket)?;
            let window = self.ports.executor.window(entry.step?, true)?;
            let until = window.latest?;
            if entry.warned.as_ref() == Some(&until) || until < self.now {
                return None;
            }
            let planned = entry.started.as_ref()? + entry.planned.as_ref()?;
            let quarter = (&until - &planned) * Rational::new(1, 4);
            let ahead = quarter.max(&self.allowance * Rational::from(2));
            Some(Late {
                ticket,
                action: entry.action.name.clone(),
                warn: (&until - ahead).max(planned),
                until,
            })
        })
    }

    /// What runs for longer than it was planned to, and was not told to stop.
    pub(super) fn overdue(&self) -> Vec<Ticket> {
        let running = self.belief.running().iter();
        let overdue = running.filter(|(ticket, underway)| {
            !self.account.is_cancelled(**ticket) && &self.now - &underway.start >= underway.planned
        });
        overdue.map(|(ticket, _)| *ticket).collect()
    }
}
