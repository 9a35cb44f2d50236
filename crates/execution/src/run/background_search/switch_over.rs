//! Switch to a finished plan.

use std::sync::Arc;

use elbowroom_model::TimeTriggeredPlan;

use crate::executor::PlanEvent;
use crate::run::agenda::{PendingStep, PreparationFallback};
use crate::run::background::BackgroundSearch;
use crate::run::plan_start::PlanStart;
use crate::run::situation::{OverrunEstimate, StartedPlan};
use crate::run::{Run, Stop};

impl Run<'_> {
    /// Processes a plan that the search has found.
    pub(super) fn process_found_plan(
        &mut self,
        mut search: BackgroundSearch,
        plan: &TimeTriggeredPlan,
    ) -> Result<(), Stop> {
        if search.query().guess == OverrunEstimate::Cancelled {
            self.cancel_overdue(search.query().reason.clone());
            return Ok(());
        }
        search.set_plan(plan.clone(), &self.now);
        if search.has_abandoned_plan() {
            return self.switch_from_empty_plan(search, plan, true);
        }
        self.background.set_search(search);
        Ok(())
    }

    /// Switches to a plan if nothing was started since the plan was requested. If the situation is
    /// not as expected, the plan is fitted to the real one, if possible. Otherwise the events are
    /// reported to the executor, which decides whether the plan is still feasible.
    pub(super) fn switch_from_empty_plan(
        &mut self,
        search: BackgroundSearch,
        plan: &TimeTriggeredPlan,
        may_fit: bool,
    ) -> Result<(), Stop> {
        if may_fit
            && !self.is_as_expected(&search)
            && let Some(fit) = search.fit_to_present(plan, &self.view())
        {
            if self.settings.prepares_in_background {
                // The fitted plan includes all events so far.
                self.plan_events.clear();
            }
            self.adopt_fitted(search, fit, |search| {
                PreparationFallback::AdoptUnfitted(Box::new(search), plan.clone())
            });
            return Ok(());
        }
        self.switch_unfitted(search, plan)
    }

    /// Returns `true` if the situation from which the plan starts is the present one.
    fn is_as_expected(&self, search: &BackgroundSearch) -> bool {
        let query = search.query();
        let time = query.start.situation.time.clone();
        let (situation, running) = self.view().situation_at(time, query.guess);
        situation == query.start.situation && running == query.start.running
    }

    /// Switches to the unchanged plan.
    pub(in crate::run) fn switch_unfitted(
        &mut self,
        search: BackgroundSearch,
        plan: &TimeTriggeredPlan,
    ) -> Result<(), Stop> {
        let query = search.query();
        let start = &query.start;
        let is_known = |ticket| start.running.contains(&ticket);
        let knows_all = self.action_log.open_tickets().all(is_known);
        if (!knows_all || !start.expected.is_empty()) && !self.is_as_expected(&search) {
            // The plan continues actions that were never started, or does not contain all running
            // actions.
            return self.search_again(&query.reason);
        }
        let as_made = (plan.clone(), start.situation.clone(), start.running.clone());
        if self.settings.prepares_in_background {
            self.begin_preparation(search, as_made, false);
            return Ok(());
        }
        self.report_past_events();
        self.adopt_plan_for_goals(&query.task, &query.goals, PlanStart::of(&as_made));
        Ok(())
    }

    /// Reports the events until now to the executor of the next plan, without the starts and ends
    /// of steps of other plans.
    pub(super) fn report_past_events(&mut self) {
        let mut surprises = std::mem::take(&mut self.plan_events);
        surprises.retain(|it| !matches!(it, PlanEvent::Started { .. } | PlanEvent::Ended { .. }));
        self.agenda.push(PendingStep::ReportNews(surprises));
    }

    /// Switches to a finished plan when it is due, or prepares it. If the plan does not fit the
    /// present state, it is outdated, and another search begins. Returns `true` if the executor makes no decision now.
    pub(super) fn switch_if_due(&mut self) -> Result<bool, Stop> {
        let view = self.view();
        let due = self
            .background
            .search()
            .filter(|it| it.is_switch_due(&view));
        let Some((plan, _)) = due.and_then(BackgroundSearch::plan) else {
            return Ok(false);
        };
        let fit = due.and_then(|search| search.fit_to_present(plan, &view));
        let Some(search) = self.background.take_search() else {
            return Ok(false);
        };
        match fit {
            Some(fit) => self.adopt_fitted(search, fit, |search| {
                if search.is_optional() {
                    PreparationFallback::ContinuePlan(search.query().reason.clone())
                } else {
                    PreparationFallback::SearchAgain(Box::new(search))
                }
            }),
            None => self.search_again(&search.query().reason)?,
        }
        Ok(true)
    }

    /// Prepares a fitted plan, in the background or at once, and begins with it.
    fn adopt_fitted(
        &mut self,
        search: BackgroundSearch,
        fit: StartedPlan,
        fallback: impl FnOnce(BackgroundSearch) -> PreparationFallback,
    ) {
        if self.settings.prepares_in_background {
            self.begin_preparation(search, fit, true);
            return;
        }
        let (task, goals) = (
            Arc::clone(&search.query().task),
            search.query().goals.clone(),
        );
        self.await_preparation(&task, &goals, PlanStart::of(&fit), fallback(search));
    }
}
