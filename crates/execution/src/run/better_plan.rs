//! Search for a better plan while the present one is executed.

use std::sync::Arc;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::pending::PreparationFallback;
use super::plan_start::PlanStart;
use super::replanning::Attempt;
use super::situation::OverrunEstimate;
use super::{PlanningTime, Run, RunningRule, Stop};
use crate::executor::{PlanForm, PreparedPlan};
use crate::planning::PlanAnswer;
use crate::reason::{Cause, Reason};
use crate::record::Entry;

impl Run<'_> {
    /// Requests a plan if the executor seeks a better one than the present one. Returns `true` if
    /// the run waits for it.
    pub(super) fn seek_better_plan(&mut self) -> bool {
        if !self.may_seek_better_plan() || !self.ports.executor.seeks_better_plan(&self.now) {
            return false;
        }
        let reason = Reason::new(Cause::MoreSlack).since(self.now.clone());
        if self.plans_aside() {
            self.search_for_a_better_plan(reason);
            return false;
        }
        let guess = OverrunEstimate::QuarterLonger;
        let (situation, running) = self.situation(&Rational::ZERO, guess);
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason: &reason,
            situation: &situation,
        });
        self.await_plan(Attempt {
            reason,
            guess,
            situation,
            running,
            is_optional: true,
        });
        true
    }

    /// Returns `true` if another plan could take over: the present one continues meanwhile, or
    /// planning takes no time in the world; and all commanded actions have started and can
    /// continue.
    fn may_seek_better_plan(&self) -> bool {
        let takes_no_time = self.settings.planning_time == PlanningTime::Seconds(Rational::ZERO);
        let has_planner = if self.plans_aside() {
            self.search.is_none() && self.anticipated_replan.is_none()
        } else {
            takes_no_time && !self.settings.plans_aside
        };
        let can_continue = |ticket| self.belief.running().contains_key(&ticket);
        has_planner
            && !self.search_results.has_better_search_failed
            && !self.search_results.is_plan_infeasible
            && self.settings.running == RunningRule::Keep
            && self.replans < self.settings.max_replans
            && self.ports.executor.need() != PlanForm::PartialOrder
            && !self.is_goal_change_pending()
            && !self.is_paused()
            && self.action_log.open_tickets().all(can_continue)
            && self.belief.failing_actions().is_empty()
    }

    /// Records that the planner has found no better plan. If there is certainly none, searching
    /// again is cheap.
    pub(super) fn note_no_better_plan(&mut self, answer: &PlanAnswer) {
        self.search_results.has_better_search_failed = *answer != PlanAnswer::Unsolvable;
    }

    /// Returns `true` if a prepared plan takes over from the present one, and counts the new plan
    /// then.
    pub(super) fn replaces_present_plan(
        &mut self,
        mission: &PreparedPlan,
        reason: &Reason,
    ) -> Result<bool, Stop> {
        if self.ports.executor.prefers_plan(mission, &self.now) {
            self.count_replan(reason)?;
            return Ok(true);
        }
        self.ports.recorder.record(&Entry::Kept {
            now: &self.now,
            reason,
        });
        Ok(false)
    }

    /// Has a plan prepared. It takes over if it is better than the present one.
    pub(super) fn prepare_better_plan(&mut self, attempt: Attempt, plan: &TimeTriggeredPlan) {
        let (task, goals) = (Arc::clone(&self.task), self.goals());
        let course = PlanStart::of(plan, &attempt.situation, &attempt.running);
        self.await_preparation(
            &task,
            &goals,
            course,
            PreparationFallback::ContinuePlan(attempt.reason),
        );
    }
}
