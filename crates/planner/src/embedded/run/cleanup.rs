//! Clean-up of the first plan, if the caller requests no other one.
//!
//! Better plans are searched for near the first plan, for a share of its work and at most the same
//! number of states. Then the best plan is reported. It has few unnecessary and back-and-forth
//! actions.

use super::super::answer::{Counts, Stopped};
use super::super::tuning::Technique;
use super::Planner;
use super::refining::LocalSearch;
use super::worker::{OPERATOR_WORK, Worker};

/// Number of comparisons of a clean-up's work with the limit.
const REPORTS: u64 = 16;

/// Minimum number of states of a first plan for a clean-up: below it, the preparation takes longer
/// than the plan.
const MIN_STATES: u64 = 64;

/// Divisor of the work up to the first plan, which gives the work of a clean-up: a unit near a plan
/// takes several times as long as one of a search.
const SHARE: u64 = 4;

impl Planner<'_> {
    /// Returns `true` if the first plan is held back until it has been cleaned up. Where actions may have to run at
    /// the same time, networks are large, and steps near a plan take much longer than their counted work.
    pub(super) fn cleans_up(&self) -> bool {
        let compiled = self.frame.compiled;
        self.frame.settings.first_plan_only
            && !compiled.is_symbolic
            && !self.needs_concurrency()
            && compiled.tuning.uses(Technique::Cleanup)
    }

    /// Returns `true` if a plan ends the run.
    pub(super) fn is_first_plan_enough(&self) -> bool {
        self.frame.settings.first_plan_only && self.cleanup_limit.is_none()
    }

    /// Returns `true` if the clean-up has taken its share of the work, or as many states as the first plan.
    pub(super) fn is_cleanup_over(&self) -> bool {
        let counts = &self.progress.counts;
        let is_over =
            |limit: &Counts| counts.work >= limit.work || counts.evaluated >= limit.evaluated;
        self.cleanup_limit.as_ref().is_some_and(is_over)
    }

    /// Searches for better plans near the first one.
    pub(super) fn clean_up(&mut self) {
        let Counts {
            work, evaluated, ..
        } = self.progress.counts;
        if evaluated < MIN_STATES {
            return;
        }
        self.stopped = None;
        self.cleanup_limit = Some(Counts {
            work: work + work / SHARE,
            evaluated: 2 * evaluated,
            ..Counts::default()
        });
        let most = work / SHARE;
        self.frame.limit_report_work(most / REPORTS);
        let (frame, best, unreported) = (self.frame, self.best.clone(), self.unreported);
        let mut nearby = LocalSearch::new(frame.compiled, 1);
        let memory = frame.settings.max_memory;
        nearby.limit_memory(memory.saturating_sub(self.progress.counts.memory));
        let (newest, mut base) = (self.improvement_count, self.progress.counts);
        let mut on_report = |report| self.process_report(&mut base, report);
        let mut strand = Worker::new(frame, best, unreported, &mut on_report);
        strand.refine(&mut nearby, newest, most / OPERATOR_WORK);
        self.unreported = strand.end(false);
        if self.stopped != Some(Stopped::Interrupted) {
            self.stopped = Some(Stopped::FirstPlan);
        }
    }

    /// Reports the best plan, if it was held back. A caller that interrupted the run gets it in the
    /// answer.
    pub(super) fn report_held_back(&mut self) {
        if self.cleans_up()
            && self.stopped != Some(Stopped::Interrupted)
            && let Some(best) = self.best.clone()
        {
            self.add_to_progress(&best);
            // The run ends in any case.
            self.report_to_caller(None);
        }
    }
}
