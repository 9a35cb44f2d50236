//! Search for a better plan while the present one is executed.

use std::sync::Arc;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::agenda::{Attempt, PreparationFallback};
use super::plan_start::PlanStart;
use super::settings::{PlanningTime, RunningRule};
use super::situation::OverrunEstimate;
use super::{Run, Stop};
use crate::executor::PreparedPlan;
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
        if self.plans_in_background() {
            self.search_beside_plan(reason, None);
            return false;
        }
        let guess = OverrunEstimate::QuarterLonger;
        let (situation, running) = self.view().situation(&Rational::ZERO, guess);
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
        let has_planner = if self.plans_in_background() {
            self.background.search().is_none() && self.background.anticipated().is_none()
        } else {
            takes_no_time && !self.settings.plans_in_background
        };
        has_planner
            && self.search_results.may_seek_better_plan()
            && self.settings.running == RunningRule::Keep
            && self.replans.remaining(self.settings.max_replans) > 0
            && !self.chooses_order()
            && !self.goals.is_change_pending()
            && !self.goals.is_paused()
            && self.view().are_all_starts_reported()
            && self.belief.failing_actions().is_empty()
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
    pub(super) fn prepare_better_plan(&mut self, attempt: Attempt, plan: TimeTriggeredPlan) {
        let (task, goals) = (Arc::clone(&self.task), self.goals.open());
        let course = (plan, attempt.situation, attempt.running);
        let fallback = PreparationFallback::ContinuePlan(attempt.reason);
        self.await_preparation(&task, &goals, PlanStart::of(&course), fallback);
    }
}
