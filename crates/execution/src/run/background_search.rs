//! Background planning: execution during a search, and the switch to the new plan.

mod preparation;
mod switch_over;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_num::Rational;

use super::agenda::PendingStep;
use super::background::{
    AnticipatedReplan, AnticipatedSituation, BackgroundSearch, ExecutionDuringSearch, PlanQuery,
    next_late_time, next_need,
};
use super::reachability::is_goal_unreachable;
use super::replanning::NextAttempt;
use super::settings::{RunningRule, Verdict};
use super::situation::OverrunEstimate;
use super::view::PredictedState;
use super::{Run, Stop};
use crate::belief_state::GoalStatus;
use crate::executor::PlanEvent;
use crate::planning::{PlanAnswer, Planned};
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;
use crate::request::Urgency;

impl Run<'_> {
    /// Returns `true` if plans are made in the background from now on.
    pub(super) fn plans_in_background(&self) -> bool {
        let has_begun = self.now.is_positive() || self.action_log.started() > 0;
        let is_waited_for = !has_begun && !self.goals.is_executive();
        self.settings.plans_in_background && !is_waited_for
    }

    /// Begins a search when a plan is needed and the present one cannot continue.
    pub(super) fn search_from_here(&mut self, reason: &Reason) {
        self.abandon_plan();
        self.plan_events.clear();
        if !self.finish_if_goal_holds(reason) {
            self.search_without_plan(reason.clone(), OverrunEstimate::QuarterLonger);
        }
    }

    /// Begins a search because the goals have changed, while the present plan continues. Returns
    /// `false` if the plan cannot continue.
    pub(super) fn search_while_plan_continues(&mut self, reason: &Reason) -> Result<bool, Stop> {
        let may_continue = self.plans_in_background()
            && self.settings.running == RunningRule::Keep
            && !self.search_results.is_plan_infeasible()
            && self.goals.plan().is_some()
            && !self.chooses_order()
            && self
                .goal_status_without_plan()
                .is_none_or(|it| it == GoalStatus::Unmet);
        if !may_continue {
            return Ok(false);
        }
        self.count_replan(reason)?;
        self.search_beside_plan(reason.clone(), None);
        Ok(true)
    }

    /// Counts a new plan. Fails if the limit is reached.
    pub(super) fn count_replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        if self.replans.try_count(reason, self.settings.max_replans) {
            return Ok(());
        }
        Err(Stop::Ended(Verdict::ReplanLimit))
    }

    /// Begins a search for a plan while the present one continues, until then if there is a limit.
    pub(super) fn search_beside_plan(&mut self, reason: Reason, until: Option<Rational>) {
        let start = self
            .view()
            .expected_situation_after_planning(until.as_ref());
        let start = self.present_start(start);
        let execution = ExecutionDuringSearch::PlanContinues { until };
        self.search(reason, OverrunEstimate::QuarterLonger, start, execution);
    }

    /// Begins a search for a plan while only the running actions continue.
    fn search_without_plan(&mut self, reason: Reason, guess: OverrunEstimate) {
        let start = self.anticipated_situation(guess).unwrap_or_else(|| {
            let (situation, running) = self.view().situation_after_planning(guess);
            self.present_start(PredictedState {
                situation,
                running,
                expected: Vec::new(),
            })
        });
        let execution = ExecutionDuringSearch::RunningActionsOnly;
        self.search(reason, guess, start, execution);
    }

    fn present_start(&self, prospect: PredictedState) -> AnticipatedSituation {
        AnticipatedSituation {
            prospect,
            since: self.now.clone(),
            abandoned_steps: BTreeMap::new(),
            is_approximate: false,
        }
    }

    fn search(
        &mut self,
        reason: Reason,
        guess: OverrunEstimate,
        start: AnticipatedSituation,
        execution: ExecutionDuringSearch,
    ) {
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason: &reason,
            situation: &start.prospect.situation,
        });
        let request = self.request_plan(&start.prospect.situation, Urgency::Background);
        let query = PlanQuery {
            guess,
            since: start.since,
            is_approximate: start.is_approximate,
            ..self.query_from(reason, start.prospect)
        };
        let timed = self.belief.past_timed_initials();
        let abandoned = start.abandoned_steps;
        let search = BackgroundSearch::new(query, request, execution, timed, abandoned);
        self.background.set_search(search);
    }

    /// Ends the search if it is optional, that is, if the present plan continues without it.
    pub(super) fn cancel_optional_search(&mut self) {
        if self.background.is_search_optional() {
            self.cancel_search();
        }
    }

    /// Ends a search whose plan is not needed any more.
    pub(super) fn cancel_search(&mut self) {
        if let Some(open) = self.background.end_search() {
            self.agenda.abandon(open);
        }
    }

    /// Abandons the present plan: none of its remaining steps is started.
    pub(super) fn abandon_plan(&mut self) {
        // It searched for a better plan than this one.
        self.cancel_optional_search();
        self.search_results.note_infeasible_plan();
        let mut anticipated = self.background.take_anticipated();
        if let Some(anticipated) = &mut anticipated {
            anticipated.keep(&self.view());
        }
        self.background.set_anticipated(anticipated);
        self.background.abandon_plan(self.action_log.steps());
        self.detach_steps();
    }

    /// Detaches the started actions from the steps of the present plan. Their effects are reported
    /// as news.
    fn detach_steps(&mut self) {
        for it in std::mem::take(&mut self.plan_events) {
            let (step, is_end) = match &it {
                PlanEvent::Started { step, .. } => (*step, false),
                PlanEvent::Ended { step, ending, .. } => {
                    if *ending != crate::event::Ending::Succeeded {
                        continue;
                    }
                    (*step, true)
                }
                _ => {
                    self.plan_events.push(it);
                    continue;
                }
            };
            if let Some(ticket) = self.action_log.ticket(step) {
                self.report_effects(ticket, is_end);
            }
        }
        self.drop_steps();
    }

    /// Returns the time of the next decision about the search if no event comes before.
    pub(super) fn next_search_decision(&self) -> Option<Rational> {
        let search = self.background.search()?;
        let next = search.next_decision(&self.view());
        if self.goals.has_abandoned_goals() == Some(true) && !self.goals.is_paused() {
            return Some(next.min(self.search_time_limit(search)));
        }
        Some(next)
    }

    /// Returns the time until which a search continues although its goals were abandoned.
    fn search_time_limit(&self, search: &BackgroundSearch) -> Rational {
        let expected = self.background.expected_time();
        &search.query().started_at + self.search_results.search_time(expected)
    }

    /// Continues the search, if there is one. Returns `true` if the executor makes no decision
    /// because of it.
    pub(super) fn poll_planner(&mut self) -> Result<bool, Stop> {
        if self.goals.is_change_pending() {
            self.cancel_optional_search();
        }
        let Some(search) = self.background.search() else {
            return Ok(false);
        };
        if self.goals.is_goal_abandoned() {
            self.cancel_search();
            return Ok(false);
        }
        if self.goals.is_paused() {
            return Ok(false);
        }
        if self.goal_status_without_plan() == Some(GoalStatus::Reached) {
            self.cancel_search();
            self.plan_events.clear();
            self.request_goal_look();
            return Ok(true);
        }
        let abandoned = self.goals.has_abandoned_goals();
        let must_end = abandoned == Some(true)
            && (self.search_results.ends_searches_at_once()
                || self.now >= self.search_time_limit(search));
        if abandoned.is_some() && (must_end || self.goals.is_empty()) {
            self.search_results.count_ended_search();
            self.cancel_search();
            return Ok(false);
        }
        if search.preparation().is_some() {
            return self.poll_preparation();
        }
        if search.plan().is_some() {
            return self.switch_if_due();
        }
        if search.has_finished() {
            self.process_search_answer()?;
            return Ok(true);
        }
        if search.is_plan_to_stop(&self.now) {
            self.abandon_plan();
        }
        self.restart_if_goals_unreachable();
        Ok(self.is_waiting_for_plan())
    }

    /// Restarts a search that has become futile because deadlines have passed since it began. From
    /// the present situation, that is proved at once, with a certificate.
    fn restart_if_goals_unreachable(&mut self) {
        let timed = self.belief.past_timed_initials();
        let Some(search) = self.background.search_mut() else {
            return;
        };
        if search.may_be_futile(timed) && is_goal_unreachable(&self.belief) {
            let (reason, guess) = (search.query().reason.clone(), search.query().guess);
            self.cancel_search();
            self.search_without_plan(reason, guess);
        }
    }

    /// Waits for the plan if only running actions continue. Returns `true` if the run waits.
    fn is_waiting_for_plan(&mut self) -> bool {
        let search = self.background.search();
        let waits = search.is_some_and(BackgroundSearch::has_abandoned_plan);
        if waits {
            self.wait_for_search();
        }
        waits
    }

    /// Waits until the next decision about the search.
    pub(super) fn wait_for_search(&mut self) {
        let timeout = self.view().next_timeout().into_iter();
        let until = timeout.chain(self.next_search_decision()).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.wait_and_check_timeouts(until);
    }

    /// Processes the planner's answer.
    fn process_search_answer(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.background.take_search() else {
            return Ok(());
        };
        let Some(Planned {
            answer,
            remark,
            shortfall,
            ..
        }) = search.take_finished()
        else {
            return Ok(());
        };
        let took = &self.now - &search.query().started_at;
        let expected = self.background.expected_time().clone();
        self.background.update_expected_time(&took);
        self.ports.recorder.record(&Entry::Planned {
            now: &self.now,
            took: &took,
            plan: answer.plan(),
            why_not: answer.failure_reason(),
            is_unsolvable: answer == PlanAnswer::Unsolvable,
            has_failed: matches!(answer, PlanAnswer::Failed { .. }),
            remark: remark.as_deref(),
            shortfall: &shortfall,
        });
        self.check_stop_request()?;
        if answer.plan().is_none() && self.search_from_earlier_start(&search, &took, &expected) {
            return Ok(());
        }
        self.goals.note_shortfall(&search.query().goals, &shortfall);
        match answer {
            PlanAnswer::Plan(plan) => self.process_found_plan(search, &plan),
            answer => self.process_failed_search(&search, &answer),
        }
    }

    /// Searches again after a failed search that took less than half of the expected time, if a
    /// plan that begins earlier may reach goals in time. Returns `false` if there is no reason to.
    fn search_from_earlier_start(
        &mut self,
        search: &BackgroundSearch,
        took: &Rational,
        expected: &Rational,
    ) -> bool {
        let query = search.query();
        let is_timed =
            query.task.deadlines().next().is_some() || self.belief.next_timed().is_some();
        let is_needed =
            !search.is_optional() && !search.is_outdated() && !self.goals.is_change_pending();
        // It may take twice as long as the last search.
        let next = took * &Rational::from(2);
        if !is_timed || !is_needed || !expected.is_positive() || &next + &next > *expected {
            return false;
        }
        self.background.set_expected_time(next);
        let reason = query.reason.clone();
        if search.has_abandoned_plan() {
            self.search_without_plan(reason, query.guess);
        } else {
            self.search_beside_plan(reason, None);
        }
        true
    }

    fn process_failed_search(
        &mut self,
        search: &BackgroundSearch,
        answer: &PlanAnswer,
    ) -> Result<(), Stop> {
        let query = search.query();
        if search.is_optional() {
            self.search_results.note_no_better_plan(answer);
        } else if self.goals.is_change_pending() {
            // Another plan is needed in any case.
            if search.has_abandoned_plan() {
                self.with_goals(super::goals::GoalManager::select_after_added_goals);
            }
        } else if search.is_outdated() {
            // There was no plan from that situation, but there may be one from the present one.
            return self.search_again(&query.reason);
        } else if search.has_abandoned_plan()
            && !query.is_approximate
            && query.start.expected.is_empty()
        {
            let reason = query.reason.clone();
            match self.next_attempt(query.guess) {
                NextAttempt::Guess(guess) => self.search_without_plan(reason, guess),
                NextAttempt::CancelOverdue => self.cancel_overdue(reason),
                NextAttempt::ContinuePlan => {
                    return self.continue_or_stop_without_plan(answer, reason);
                }
            }
        } else if search.has_abandoned_plan()
            || !self.with_goals(super::goals::GoalManager::exclude_new_goals)
        {
            // The situation was only a forecast.
            self.search_from_here(&query.reason);
        }
        Ok(())
    }

    /// Searches for another plan because the finished one is outdated, unless the present plan
    /// continues.
    pub(super) fn search_again(&mut self, first: &Reason) -> Result<(), Stop> {
        if first.cause == Cause::MoreSlack {
            return Ok(());
        }
        let about = "events during planning".to_owned();
        let reason = Reason::new(Cause::Surprise).about(Subject::ExternalMessage(about));
        let reason = if self.goals.is_change_pending() {
            first
        } else {
            &reason
        };
        let stops_plan = self.search_results.count_outdated_plan();
        self.count_replan(reason)?;
        if stops_plan {
            self.agenda.push(PendingStep::Plan(reason.clone()));
            self.settle_running_actions();
            self.search_results.note_infeasible_plan();
            return Ok(());
        }
        // The search is expected to take about as long again.
        let ahead = self.background.expected_time() * &Rational::new(3, 2);
        let until = &self.now + ahead + self.task.epsilon();
        self.search_beside_plan(reason.clone(), Some(until));
        Ok(())
    }

    /// Notifies the planner of the expected situation at `until`, when a plan will be needed, or
    /// before that if another action is late.
    pub(super) fn announce_expected_situation(&mut self, until: &Rational) {
        if self.background.is_search_optional() {
            // The optional search comes first. If its plan does not take over, there is another
            // call.
            return;
        }
        let anticipated = AnticipatedReplan::at(until, &self.view());
        self.request_plan(anticipated.situation(), Urgency::Anticipated);
        self.background.set_anticipated(Some(anticipated));
    }

    /// Updates the forecast if the execution deviates from it. Returns the time of the next check.
    pub(super) fn update_forecast(&mut self) -> Option<Rational> {
        if !self.settings.monitors_slack || self.background.search().is_some() {
            return None;
        }
        let Some(until) = next_need(&self.view()) else {
            // The late action has ended, unless the plan is needed now.
            self.background.forget_future_anticipated(&self.now);
            return None;
        };
        let anticipated = self.background.anticipated();
        let is_right = anticipated.is_some_and(|it| it.is_right(&until, &self.view()));
        if !is_right {
            self.announce_expected_situation(&until);
        }
        next_late_time(&until, &self.view())
    }

    /// Returns the foreseen situation if it is near and the execution was as foreseen.
    pub(super) fn anticipated_situation(
        &mut self,
        guess: OverrunEstimate,
    ) -> Option<AnticipatedSituation> {
        let anticipated = self.background.take_anticipated()?;
        anticipated.for_request(guess, &self.view(), self.plans_in_background())
    }

    /// Returns the question for a plan from this situation, now.
    fn query_from(&self, reason: Reason, start: PredictedState) -> PlanQuery {
        PlanQuery {
            reason,
            guess: OverrunEstimate::QuarterLonger,
            task: Arc::clone(&self.task),
            goals: self.goals.open(),
            start,
            started_at: self.now.clone(),
            since: self.now.clone(),
            is_approximate: false,
        }
    }
}
