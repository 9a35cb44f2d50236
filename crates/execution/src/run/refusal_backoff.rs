//! Growing waits after repeated refusals of an action, with background planning.
//!
//! The same situation leads to the same plan, and that to the same refusal. If no other event has
//! happened in between, only time can help. So the plan after the second refusal of an action in a
//! row is requested 0.1 s later, and the delay doubles with each further refusal. A temporary
//! refusal then costs only a few plans, and the limit on new plans is not used up before the cause
//! can be removed.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

/// Maximum number of doublings of the wait: to 51 s.
const MAX_DOUBLINGS: u32 = 9;

/// Refusals since the last other event.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RefusalBackoff {
    /// Number of refusals, by the action's name.
    pub times: BTreeMap<String, u32>,
    /// Time until when no plan is requested.
    pub until: Rational,
}

impl RefusalBackoff {
    /// Records that an action has ended without having started.
    pub(super) fn record_refusal(&mut self, action: &str, now: &Rational) {
        let times = self.times.entry(action.to_owned()).or_default();
        *times += 1;
        let Some(doublings) = times.checked_sub(2) else {
            return;
        };
        let wait = Rational::new(1_i64 << doublings.min(MAX_DOUBLINGS), 10);
        self.until = (now + wait).max(self.until.clone());
    }

    /// Forgets the refusals after another event, or when other goals are pursued.
    pub(super) fn reset(&mut self) {
        if !self.times.is_empty() {
            *self = Self::default();
        }
    }
}
