//! The clean-up of a first plan that is all that the caller asked for.
//!
//! The searches, and the search near the best plan, continue for as much work as the first plan took. The caller
//! is told of the best plan after that. Needless and back-and-forth actions are mostly gone then.

use super::super::answer::Stopped;
use super::super::tuning::Technique;
use super::Planner;

/// So many times in a clean-up, work is compared with its limit.
const REPORTS: u64 = 16;

impl Planner<'_> {
    /// Returns `true` if the first plan is held back until it has been cleaned up.
    pub(super) fn cleans_up(&self) -> bool {
        let tuning = &self.frame.compiled.tuning;
        self.frame.settings.first_plan_only && tuning.uses(Technique::Cleanup)
    }

    /// Returns `true` if a plan ends the search.
    pub(super) fn is_first_plan_enough(&self) -> bool {
        self.frame.settings.first_plan_only && self.cleanup_limit.is_none()
    }

    /// Returns `true` if the clean-up has taken as much work as the first plan.
    pub(super) fn is_cleanup_over(&self) -> bool {
        let work = self.progress.counts.work;
        self.cleanup_limit.is_some_and(|limit| work >= limit)
    }

    /// Lets the run continue after the first plan.
    pub(super) fn begin_cleanup(&mut self) {
        let work = self.progress.counts.work;
        self.stopped = None;
        self.cleanup_limit = Some(work.saturating_mul(2));
        self.frame.limit_report_work(work / REPORTS);
    }

    /// Tells the caller of the best plan, if it was held back, and why the run ends, which would have ended for
    /// the first plan.
    pub(super) fn end_cleanup(&mut self, stopped: Stopped) -> Stopped {
        let best = self.best.clone().filter(|_| self.cleans_up());
        let Some(best) = best else {
            return stopped;
        };
        self.show(&best);
        // The run ends in any case.
        self.tell(None);
        if self.cleanup_limit.is_some() && stopped != Stopped::Interrupted {
            Stopped::FirstPlan
        } else {
            stopped
        }
    }
}
