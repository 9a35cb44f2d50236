//! Count of new plans, with their reasons.

use crate::reason::Reason;

/// Number of reasons that an executive keeps.
const MAX_REASONS: usize = 1000;

/// Greatest number of new plans, as a multiple of the permitted number without a completed action.
/// It ends a run that completes actions for ever, but never reaches its goal.
const MAX_ROUNDS: usize = 10;

/// The new plans of a run; of an executive, since it was last idle.
#[derive(Clone, Debug, Default)]
pub(super) struct Replans {
    count: usize,
    /// The new plans since an action was last completed.
    without_progress: usize,
    reasons: Vec<Reason>,
}

impl Replans {
    pub(super) fn restored(count: usize) -> Self {
        Self {
            count,
            ..Self::default()
        }
    }

    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// Counts a new plan. Returns `false` if no more are permitted; then it is not counted, but its
    /// reason is kept. `most` is the permitted number without a completed action.
    pub(super) fn try_count(&mut self, reason: &Reason, most: usize) -> bool {
        self.reasons.push(reason.clone());
        let is_permitted = self.remaining(most) > 0;
        self.count += usize::from(is_permitted);
        self.without_progress += usize::from(is_permitted);
        is_permitted
    }

    /// Returns how many new plans are permitted until an action is completed. See
    /// [`try_count`](Self::try_count).
    pub(super) fn remaining(&self, most: usize) -> usize {
        let in_all = MAX_ROUNDS.saturating_mul(most).saturating_sub(self.count);
        most.saturating_sub(self.without_progress).min(in_all)
    }

    /// Notes that an action was completed successfully.
    pub(super) fn note_progress(&mut self) {
        self.without_progress = 0;
    }

    /// Forgets the last reason, whose plan was not made.
    pub(super) fn forget_last_reason(&mut self) {
        self.reasons.pop();
    }

    pub(super) fn reset_count(&mut self) {
        self.count = 0;
        self.without_progress = 0;
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

#[cfg(test)]
mod tests {
    use super::{MAX_ROUNDS, Replans};
    use crate::reason::{Cause, Reason};

    const MOST: usize = 3;

    fn count(replans: &mut Replans) -> bool {
        replans.try_count(&Reason::new(Cause::NewPlan), MOST)
    }

    #[test]
    fn number_of_new_plans_is_limited_until_an_action_is_completed() {
        let mut replans = Replans::default();
        assert_eq!((0..5).filter(|_| count(&mut replans)).count(), MOST);
        replans.note_progress();
        assert!(count(&mut replans));
        assert_eq!(replans.count(), MOST + 1);
    }

    #[test]
    fn number_of_new_plans_is_limited_with_completed_actions_too() {
        let mut replans = Replans::default();
        let counted = (0..100).filter(|_| {
            replans.note_progress();
            count(&mut replans)
        });
        assert_eq!(counted.count(), MAX_ROUNDS * MOST);
    }

    #[test]
    fn no_new_plan_is_permitted_if_the_limit_is_zero() {
        let mut replans = Replans::default();
        replans.note_progress();
        assert!(!replans.try_count(&Reason::new(Cause::NewPlan), 0));
    }
}
