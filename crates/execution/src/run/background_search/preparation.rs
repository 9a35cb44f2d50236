//! Background preparation of plans: execution meanwhile, and the switch to the new plan.
//!
//! A plan is prepared for a moment, with the actions running then. It takes over as if it had been
//! adopted at that moment, and its executor is notified at once of all starts and ends since. So
//! the executor's own checks of times and amounts decide whether the plan is still feasible.

use std::collections::BTreeMap;

use crate::event::ActionHandle;
use crate::executor::Order;
use crate::preparation::PrepareError;
use crate::record::Entry;
use crate::run::background::{BackgroundSearch, ExecutionDuringSearch, Preparation};
use crate::run::goals::PendingGoalChange;
use crate::run::plan_start::{PlanStart, preparation_failure};
use crate::run::search_results::MAX_FITTINGS;
use crate::run::settings::RunningRule;
use crate::run::situation::StartedPlan;
use crate::run::view::PredictedState;
use crate::run::{Run, Stop};

impl Run<'_> {
    /// Begins to prepare a plan.
    pub(super) fn begin_preparation(
        &mut self,
        mut search: BackgroundSearch,
        course: StartedPlan,
        is_fitted: bool,
    ) {
        let request = self.request_preparation(&search.query().task, PlanStart::of(&course));
        search.prepare(request, course, self.action_log.started(), is_fitted);
        self.background.set_search(search);
    }

    /// Returns `true` if these actions can be started, also while a plan is being prepared.
    pub(in crate::run) fn may_start(&self, orders: &[Order]) -> bool {
        let search = self.background.search();
        let preparation = search.and_then(BackgroundSearch::preparation);
        preparation.is_none_or(|it| it.may_start(orders, &self.view()))
    }

    /// Continues a preparation. Returns `true` if the executor makes no decision now.
    pub(super) fn poll_preparation(&mut self) -> Result<bool, Stop> {
        let Some(search) = self.background.search() else {
            return Ok(false);
        };
        let Some(preparation) = search.preparation() else {
            return Ok(false);
        };
        let Some(since) = preparation.ready_since() else {
            // No step of the plan begins before its start time.
            let (_, situation, _) = preparation.course();
            if !search.has_abandoned_plan() && self.now >= situation.time {
                return Ok(false);
            }
            self.wait_for_search();
            return Ok(true);
        };
        if preparation.waits_for_reports(&self.view(), since) {
            if search.is_optional() {
                self.cancel_search();
                return Ok(false);
            }
            self.abandon_plan();
            self.wait_for_search();
            return Ok(true);
        }
        self.switch_to_prepared()?;
        Ok(true)
    }

    /// Switches to a prepared plan if the events meanwhile were as expected.
    fn switch_to_prepared(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.background.take_search() else {
            return Ok(());
        };
        let Some(mut preparation) = search.take_preparation() else {
            return Ok(());
        };
        let Some(prepared) = preparation.take_prepared() else {
            return Ok(());
        };
        self.check_stop_request()?;
        let begun: Vec<ActionHandle> = preparation.starts_since(&self.action_log).collect();
        let mut mission = match prepared {
            Ok(mission) => mission,
            Err(error) => {
                return self.handle_failed_preparation(search, &preparation, &begun, &error);
            }
        };
        let steps = self.action_log.match_steps(&mission, &begun);
        let agrees = !preparation.is_outdated()
            && !preparation.has_unreported_start(&self.view())
            && steps.is_some();
        if search.is_optional() {
            if !agrees || !self.replaces_present_plan(&mission, &search.query().reason)? {
                return Ok(());
            }
        } else if !agrees && (search.preparations() <= MAX_FITTINGS || !begun.is_empty()) {
            search = match self.refit(search)? {
                // Its executor is notified instead.
                Some(search) if begun.is_empty() => search,
                Some(search) => return self.search_again(&search.query().reason),
                None => return Ok(()),
            };
        }
        if let Some(change) = search.kept_for_change() {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &change.reason,
            });
        } else {
            let took = &self.now - &search.query().started_at;
            self.background.raise_expected_time(took);
        }
        self.report_past_events();
        self.background.set_plan_task(&search.query().task);
        mission.begun = steps.unwrap_or_default();
        mission.now.clone_from(&self.now);
        let course = PlanStart {
            begun_steps: &begun,
            ..PlanStart::of(preparation.course())
        };
        self.begin_prepared_plan_for_goals(course, &search.query().goals, &mission)
    }

    fn handle_failed_preparation(
        &mut self,
        mut search: BackgroundSearch,
        preparation: &Preparation,
        begun: &[ActionHandle],
        error: &PrepareError,
    ) -> Result<(), Stop> {
        if let Some(change) = search.take_kept_for_change() {
            return self.replan_for_changed_goals(&change);
        }
        if search.is_optional() {
            return Ok(());
        }
        if !search.has_abandoned_plan() || !begun.is_empty() {
            return self.search_again(&search.query().reason);
        }
        let plan = search.plan().filter(|_| preparation.is_fitted());
        match plan.map(|(plan, _)| plan.clone()) {
            Some(plan) => self.switch_from_empty_plan(search, &plan, false),
            None => Err(Stop::Ended(preparation_failure(error))),
        }
    }

    /// Fits the plan again after unexpected events during its preparation, or requests another one.
    /// Returns the search if the executor of the plan is to be notified instead.
    fn refit(&mut self, mut search: BackgroundSearch) -> Result<Option<BackgroundSearch>, Stop> {
        if let Some(change) = search.take_kept_for_change() {
            if self.search_results.count_outdated_kept_plan() {
                self.replan_for_changed_goals(&change)?;
            } else {
                self.goals.requeue_change(change);
            }
            return Ok(None);
        }
        let went_on = !search.has_abandoned_plan();
        self.background.set_search(search);
        if went_on {
            self.abandon_plan();
        }
        let Some(search) = self.background.take_search() else {
            return Ok(None);
        };
        let plan = search.plan();
        if let Some(fit) = plan.and_then(|(plan, _)| search.fit_to_present(plan, &self.view())) {
            self.plan_events.clear();
            self.begin_preparation(search, fit, true);
            return Ok(None);
        }
        if went_on || !search.query().start.expected.is_empty() {
            self.search_again(&search.query().reason)?;
            return Ok(None);
        }
        Ok(Some(search))
    }

    /// Prepares the remaining plan for other goals.
    pub(in crate::run) fn prepare_remaining_plan(
        &mut self,
        change: PendingGoalChange,
        rest: StartedPlan,
    ) {
        let may_go_on = !self.search_results.is_plan_infeasible()
            && self.settings.running == RunningRule::Keep
            && !self.chooses_order();
        let start = PredictedState {
            situation: rest.1.clone(),
            running: rest.2.clone(),
            expected: Vec::new(),
        };
        let query = self.query_from(change.reason.clone(), start);
        let request = self.agenda.next_request();
        let execution = ExecutionDuringSearch::PlanContinues { until: None };
        let timed = self.belief.past_timed_initials();
        let search = BackgroundSearch::new(query, request, execution, timed, BTreeMap::new());
        self.begin_preparation(search.keeping_plan(change), rest, true);
        if !may_go_on {
            self.abandon_plan();
        }
    }
}
