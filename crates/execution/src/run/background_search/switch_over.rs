//! Switch to a finished plan.

use std::sync::Arc;

use elbowroom_model::TimeTriggeredPlan;
use elbowroom_num::Rational;

use super::super::pending::PreparationFallback;
use super::super::plan_start::PlanStart;
use super::super::prediction::ExpectedStart;
use super::super::{Run, Stop};
use super::fitting::StartedPlan;
use super::{BackgroundSearch, ExecutionDuringSearch, MAX_START_REPORT_WAIT};
use crate::executor::PlanEvent;

impl Run<'_> {
    /// Switches to a plan if nothing was started since the plan was requested. If the situation is
    /// not as expected, the plan is fitted to the real one, if possible. Otherwise the events are
    /// reported to the executor, which decides whether the plan is still feasible.
    pub(super) fn switch_from_empty_plan(
        &mut self,
        search: BackgroundSearch,
        plan: &TimeTriggeredPlan,
        may_fit: bool,
    ) -> Result<(), Stop> {
        let time = search.situation.time.clone();
        let (situation, running) = self.situation_at(time, search.guess);
        let is_as_expected = situation == search.situation && running == search.running;
        if !is_as_expected
            && may_fit
            && let Some(fit) = self.fit_to_present(&search, plan)
        {
            if self.settings.readies_aside {
                // The fitted plan includes all events so far.
                self.plan_events.clear();
                self.begin_preparation(search, fit, true);
                return Ok(());
            }
            let (fitted, situation, running) = fit;
            let course = PlanStart::of(&fitted, &situation, &running);
            let (task, goals) = (Arc::clone(&search.task), search.goals.clone());
            let otherwise = PreparationFallback::AdoptUnfitted(Box::new(search), plan.clone());
            self.await_preparation(&task, &goals, course, otherwise);
            return Ok(());
        }
        self.switch_unfitted(search, plan)
    }

    /// Switches to the unchanged plan.
    pub(in crate::run) fn switch_unfitted(
        &mut self,
        search: BackgroundSearch,
        plan: &TimeTriggeredPlan,
    ) -> Result<(), Stop> {
        let time = search.situation.time.clone();
        let (situation, running) = self.situation_at(time, search.guess);
        let is_as_expected = situation == search.situation && running == search.running;
        let is_known = |ticket| search.running.contains(&ticket);
        let knows_all = self.action_log.open_tickets().all(is_known);
        if !is_as_expected && (!knows_all || !search.expected.is_empty()) {
            // The plan continues actions that were never started, or does not contain all running
            // actions.
            return self.search_again(&search.reason);
        }
        if self.settings.readies_aside {
            let as_made = (
                plan.clone(),
                search.situation.clone(),
                search.running.clone(),
            );
            self.begin_preparation(search, as_made, false);
            return Ok(());
        }
        self.report_past_events();
        let course = PlanStart::of(plan, &search.situation, &search.running);
        self.adopt_plan_for_goals(&search.task, &search.goals, course);
        Ok(())
    }

    /// Reports the events until now to the executor of the next plan, without the starts and ends
    /// of steps of other plans.
    pub(super) fn report_past_events(&mut self) {
        let mut surprises = std::mem::take(&mut self.plan_events);
        surprises.retain(|it| !matches!(it, PlanEvent::Started { .. } | PlanEvent::Ended { .. }));
        self.work_queue
            .push(super::PendingStep::ReportNews(surprises));
    }

    /// Switches to a finished plan when it is due, or prepares it. Returns `true` if the executor
    /// makes no decision now.
    pub(super) fn switch_if_due(&mut self) -> Result<bool, Stop> {
        let Some(search) = &self.search else {
            return Ok(false);
        };
        let Some((plan, since)) = &search.plan else {
            return Ok(false);
        };
        let is_begun = |it: &ExpectedStart| self.action_log.ticket(it.step).is_some();
        // With background preparation, steps that have not begun are part of the prepared plan.
        let is_due = self.settings.readies_aside
            || self.now >= search.situation.time
            || search.expected.iter().all(is_begun);
        // A plan cannot include commanded actions whose start has not been reported.
        let is_told = |ticket| self.belief.running().contains_key(&ticket);
        let waits_for_word = !self.action_log.open_tickets().all(is_told)
            && self.now < since + Rational::from(MAX_START_REPORT_WAIT);
        if search.execution != ExecutionDuringSearch::RunningActionsOnly
            && (!is_due || waits_for_word)
        {
            return Ok(false);
        }
        let fit = self.fit_to_present(search, plan);
        let Some(search) = self.search.take() else {
            return Ok(false);
        };
        self.switch_to_fitted(search, fit)?;
        Ok(true)
    }

    /// Switches to the fitted plan, or prepares it. Without a fit, the plan is outdated.
    fn switch_to_fitted(
        &mut self,
        search: BackgroundSearch,
        fit: Option<StartedPlan>,
    ) -> Result<(), Stop> {
        if let Some(fit) = fit {
            if self.settings.readies_aside {
                self.begin_preparation(search, fit, true);
                return Ok(());
            }
            let (plan, situation, running) = fit;
            let course = PlanStart::of(&plan, &situation, &running);
            let (task, goals) = (Arc::clone(&search.task), search.goals.clone());
            let otherwise = if search.is_optional() {
                PreparationFallback::ContinuePlan(search.reason)
            } else {
                PreparationFallback::SearchAgain(Box::new(search))
            };
            self.await_preparation(&task, &goals, course, otherwise);
            return Ok(());
        }
        self.search_again(&search.reason)
    }
}
