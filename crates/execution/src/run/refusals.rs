//! Actions that the world refuses again and again: patience, where plans are made beside the run.
//!
//! The same situation leads to the same plan, and that to the same refusal. When nothing else has
//! happened in between, only time can help: the plan after the second refusal of an action in a row is
//! asked for a tenth of a second later, and after each further one twice as much later. So a world that
//! refuses something for a moment costs a few plans, and the number of new plans that may be made is not used up
//! before anybody could have done anything about it.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::Run;
use super::agenda::Todo;
use crate::reason::Reason;

/// How often the wait is doubled at most: to 51 seconds.
const MOST_DOUBLINGS: u32 = 9;

/// What was refused since anything else has happened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Refusals {
    /// By the action's name: how often.
    pub times: BTreeMap<String, u32>,
    /// Until when no plan is asked for.
    pub until: Rational,
}

impl Refusals {
    /// An action has ended without having started.
    pub(super) fn note(&mut self, action: &str, now: &Rational) {
        let times = self.times.entry(action.to_owned()).or_default();
        *times += 1;
        let Some(doublings) = times.checked_sub(2) else {
            return;
        };
        let wait = Rational::new(1_i64 << doublings.min(MOST_DOUBLINGS), 10);
        self.until = (now + wait).max(self.until.clone());
    }

    /// Something else has happened, or other goals are pursued.
    pub(super) fn forget(&mut self) {
        if !self.times.is_empty() {
            *self = Self::default();
        }
    }
}

impl Run<'_> {
    /// Lets time pass before a plan is asked for, if what was refused would only be refused again; whether
    /// it does.
    pub(super) fn has_patience(&mut self, reason: &Reason) -> bool {
        let until = self.refusals.until.clone();
        if !self.settings.plans_aside || self.now >= until || self.is_to_turn() {
            return false;
        }
        self.agenda.push(Todo::Replan(reason.clone()));
        self.agenda.push(Todo::CheckTimeouts);
        let timeout = self.next_timeout().into_iter();
        let until = timeout.chain([until]).min().unwrap_or_default();
        self.agenda.push(Todo::Pass(until.max(self.now.clone())));
        true
    }
}
