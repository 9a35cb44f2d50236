//! Count of new plans, with their reasons.

use crate::reason::Reason;

/// Number of reasons that an executive keeps.
const MAX_REASONS: usize = 1000;

/// The new plans of a run; of an executive, since it was last idle.
#[derive(Clone, Debug, Default)]
pub(super) struct Replans {
    count: usize,
    reasons: Vec<Reason>,
}

impl Replans {
    pub(super) fn restored(count: usize) -> Self {
        Self {
            count,
            reasons: Vec::new(),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Counts a new plan. Returns `false` if there are `most` already; then it is not counted, but
    /// its reason is kept.
    pub(super) fn try_count(&mut self, reason: &Reason, most: usize) -> bool {
        self.reasons.push(reason.clone());
        let is_permitted = self.count < most;
        self.count += usize::from(is_permitted);
        is_permitted
    }

    /// Forgets the last reason, whose plan was not made.
    pub(super) fn forget_last_reason(&mut self) {
        self.reasons.pop();
    }

    pub(super) fn reset_count(&mut self) {
        self.count = 0;
    }

    pub(super) fn forget_reasons(&mut self) {
        self.reasons.clear();
    }

    /// Forgets the earliest reasons when there are very many.
    pub(super) fn prune(&mut self) {
        if self.reasons.len() >= 2 * MAX_REASONS {
            self.reasons.drain(..MAX_REASONS);
        }
    }

    pub(super) fn take_reasons(&mut self) -> Vec<Reason> {
        std::mem::take(&mut self.reasons)
    }
}
