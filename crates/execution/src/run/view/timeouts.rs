//! Time-outs of actions.

use elbowroom_num::Rational;

use super::RunView;
use crate::event::ActionHandle;

/// Longest wait for the end of a cancelled action, in seconds of the world's clock.
const CANCEL_TIMEOUT: i64 = 600;

/// The same for an action that was cancelled because it had reached its time-out.
const CANCEL_TIMEOUT_AFTER_TIMEOUT: i64 = 10;

/// An action that can time out.
pub(in crate::run) struct ActionTimeout {
    pub(in crate::run) ticket: ActionHandle,
    /// The time of the warning; `None` if it was given, or if the action has been cancelled.
    pub(in crate::run) warn: Option<Rational>,
    /// The time-out.
    pub(in crate::run) until: Rational,
}

impl RunView<'_> {
    /// Returns the time-outs of the actions that have not ended, on the world's clock.
    pub(in crate::run) fn action_timeouts(&self) -> impl Iterator<Item = ActionTimeout> + '_ {
        let open = self.log.open_tickets();
        open.filter_map(|ticket| {
            let entry = self.log.get(ticket)?;
            if let Some(cancelled) = &entry.cancelled {
                let stopping = match entry.timed_out {
                    Some(_) => CANCEL_TIMEOUT_AFTER_TIMEOUT,
                    None => CANCEL_TIMEOUT,
                };
                return Some(ActionTimeout {
                    ticket,
                    warn: None,
                    until: cancelled + Rational::from(stopping),
                });
            }
            let planned = entry.planned.clone().unwrap_or_default();
            let timeout = self.settings.timeout.of(&entry.action.name, &planned)?;
            let began = entry.started.as_ref().unwrap_or(&entry.commanded);
            let progress = entry.progress.as_ref().map_or(began, |(time, _)| time);
            let until = began.max(progress) + &timeout;
            // The warning comes when a quarter of the time between the planned end and the time-out
            // is left.
            let since = if planned < timeout {
                planned
            } else {
                Rational::ZERO
            };
            let ahead = (timeout - since) * Rational::new(1, 4);
            let is_new = entry.warned_timeout.as_ref() != Some(&until);
            Some(ActionTimeout {
                ticket,
                warn: is_new.then(|| &until - ahead),
                until,
            })
        })
    }

    /// Returns the time of the next warning or time-out. An action may end exactly at its time-out,
    /// and several reports on one moment may arrive one after the other, so it is cancelled ε
    /// later. While an action is running that never times out, the time limit of the run is
    /// returned at the latest.
    pub(in crate::run) fn next_timeout(&self) -> Option<Rational> {
        let epsilon = self.task.epsilon();
        let due = self.action_timeouts();
        let due = due.map(|limit| limit.warn.unwrap_or_else(|| limit.until + epsilon));
        let mut open = self.log.open_tickets();
        let end = open.next().map(|_| self.settings.time_limit.clone());
        due.chain(end).min()
    }
}
