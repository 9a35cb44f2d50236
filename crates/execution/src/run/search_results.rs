//! Results of earlier searches, and state of the present plan, since a plan was last adopted.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::action_log::{ActionLog, PlanLog};
use super::settings::Verdict;
use crate::event::ActionHandle;
use crate::executor::PlanEvent;
use crate::planning::PlanAnswer;
use crate::reason::Reason;

/// Number of searches in a row that end at once when goals are abandoned. The next one continues
/// for a limited time ([`SearchResults::search_time`]), so that frequent changes of goals do not
/// block the run.
const MAX_ENDED_SEARCHES: usize = 3;

/// Minimum time for which a search may continue although its goals were abandoned, in seconds of
/// the world's clock. The time is at least twice the expected planning time. It doubles each time
/// that it passes before there is a plan.
const MIN_SEARCH_TIME: i64 = 5;

/// Maximum number of doublings of that time.
const MAX_DOUBLINGS: u32 = 20;

/// Number of times that a plan is fitted and prepared again because of unexpected reports. After
/// that, its executor is notified of them, so that a run with frequent unexpected events does not
/// wait forever.
pub(super) const MAX_FITTINGS: usize = 2;

/// Results of earlier searches, and state of the present plan, since a plan was last adopted.
#[derive(Clone, Debug, Default)]
pub(super) struct SearchResults {
    is_plan_infeasible: bool,
    /// The doubts that arose until then were asked about.
    asked_until: Option<Rational>,
    /// `true` until the world has answered the last question about doubts.
    is_inquiry_open: bool,
    /// The plan that the executor abandoned, until another one is adopted.
    abandoned: Option<AbandonedPlan>,
    /// The time at which no plan was found and the executor continued, and the verdict that applies
    /// if it stops; `None` after the next event.
    failed_at: Option<(Rational, Verdict)>,
    /// `true` if a search for a better plan has used up its budget. No other one begins until there
    /// is a new plan.
    has_better_search_failed: bool,
    /// Number of plans in a row that were outdated when they were finished.
    outdated_plans: usize,
    /// Number of searches in a row that ended because goals were abandoned.
    ended_searches: usize,
    /// Number of these that had continued for a limited time.
    ended_after_time_limit: u32,
    /// Number of times in a row that the plan was to be kept for other goals, and was outdated when
    /// it was prepared.
    outdated_kept_plans: usize,
}

/// State of a plan's actions when the executor abandoned the plan.
#[derive(Clone, Debug)]
pub(super) struct AbandonedPlan {
    pub(super) reason: Reason,
    plan: PlanLog,
    started: BTreeSet<ActionHandle>,
    ended: BTreeSet<ActionHandle>,
}

impl AbandonedPlan {
    /// Returns the state of the present plan, abandoned for this reason.
    pub(super) fn of(log: &ActionLog, reason: &Reason) -> Self {
        let starts = || log.plan_starts();
        let started = starts().filter(|(_, entry)| entry.started.is_some());
        let ended = starts().filter(|(_, entry)| entry.ended.is_some());
        Self {
            reason: reason.clone(),
            plan: log.plan().clone(),
            started: started.map(|(ticket, _)| ticket).collect(),
            ended: ended.map(|(ticket, _)| ticket).collect(),
        }
    }

    /// Returns the starts and ends of the plan's steps since then, and the plan.
    pub(super) fn resume(self, log: &ActionLog) -> (Vec<PlanEvent>, PlanLog) {
        let mut missed = Vec::new();
        for (&step, &ticket) in &self.plan.steps {
            if !self.started.contains(&ticket) {
                missed.extend(log.start_event(step, ticket));
            }
            if !self.ended.contains(&ticket) {
                missed.extend(log.end_event(step, ticket));
            }
        }
        missed.sort_by(|(one, _), (other, _)| one.cmp(other));
        let missed = missed.into_iter().map(|(_, event)| event);
        (missed.collect(), self.plan)
    }
}

impl SearchResults {
    pub(super) fn is_plan_infeasible(&self) -> bool {
        self.is_plan_infeasible
    }

    pub(super) fn note_infeasible_plan(&mut self) {
        self.is_plan_infeasible = true;
    }

    pub(super) fn note_abandoned(&mut self, plan: AbandonedPlan) {
        self.abandoned = Some(plan);
    }

    pub(super) fn has_abandoned_plan(&self) -> bool {
        self.abandoned.is_some()
    }

    pub(super) fn take_abandoned(&mut self) -> Option<AbandonedPlan> {
        self.abandoned.take()
    }

    /// Records that the executor continues the plan that it abandoned. If it stops before the next
    /// event, the run ends with this verdict.
    pub(super) fn continue_abandoned(&mut self, now: &Rational, verdict: Verdict) {
        self.is_plan_infeasible = false;
        self.failed_at = Some((now.clone(), verdict));
    }

    /// Records an event, or that goals have changed: the last failure to find a plan does not count
    /// any more.
    pub(super) fn forget_failure(&mut self) {
        self.failed_at = None;
    }

    /// Returns the verdict if no plan was found at this time.
    pub(super) fn failure_at(&self, now: &Rational) -> Option<&Verdict> {
        let failed = self.failed_at.as_ref().filter(|(time, _)| time == now);
        failed.map(|(_, verdict)| verdict)
    }

    /// Records that the planner has found no better plan. If there is certainly none, searching
    /// again is cheap.
    pub(super) fn note_no_better_plan(&mut self, answer: &PlanAnswer) {
        self.has_better_search_failed = *answer != PlanAnswer::Unsolvable;
    }

    /// Returns `true` if a better plan may be searched for.
    pub(super) fn may_seek_better_plan(&self) -> bool {
        !self.has_better_search_failed && !self.is_plan_infeasible
    }

    /// Begins a question to the world about the doubts until `latest`. Returns `false` if it was
    /// asked about them before.
    pub(super) fn begin_inquiry(&mut self, latest: &Rational) -> bool {
        let is_new = self.asked_until.as_ref() < Some(latest);
        if is_new {
            self.asked_until = Some(latest.clone());
            self.is_inquiry_open = true;
        }
        is_new
    }

    /// Ends the open question about doubts. Returns `false` if there is none.
    pub(super) fn end_inquiry(&mut self) -> bool {
        std::mem::take(&mut self.is_inquiry_open)
    }

    /// Counts an outdated plan. Returns `true` if the present plan is not to continue during the
    /// next search.
    pub(super) fn count_outdated_plan(&mut self) -> bool {
        self.outdated_plans += 1;
        self.outdated_plans > 1 || self.is_plan_infeasible
    }

    /// Counts an outdated plan that was to be kept for other goals. Returns `true` if another plan
    /// is to be made instead.
    pub(super) fn count_outdated_kept_plan(&mut self) -> bool {
        self.outdated_kept_plans += 1;
        self.outdated_kept_plans > MAX_FITTINGS
    }

    /// Returns `true` if a search ends at once when its goals are abandoned.
    pub(super) fn ends_searches_at_once(&self) -> bool {
        self.ended_searches < MAX_ENDED_SEARCHES
    }

    /// Counts a search that ends because its goals were abandoned.
    pub(super) fn count_ended_search(&mut self) {
        self.ended_after_time_limit += u32::from(!self.ends_searches_at_once());
        self.ended_searches += 1;
    }

    /// Returns the time for which a search continues although its goals were abandoned.
    ///
    /// It is bounded because a search may never end. It grows with each such search, so that a plan
    /// can be finished even if the goals change all the time.
    pub(super) fn search_time(&self, expected: &Rational) -> Rational {
        let expected = expected * &Rational::from(2);
        let patience = expected.max(Rational::from(MIN_SEARCH_TIME));
        let doublings = self.ended_after_time_limit.min(MAX_DOUBLINGS);
        patience * Rational::from(1_i64 << doublings)
    }
}
