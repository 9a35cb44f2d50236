//! Background planning: execution during a search, and the switch to the new plan.

mod background_preparation;
mod fitting;
mod switch_over;

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::abandoned_plan::AbandonedPlan;
use super::anticipated_replan::AnticipatedSituation;
use super::dead_end::is_goal_unreachable;
use super::doubts::DoubtInquiry;
use super::observations::Remark;
use super::persistent::PendingGoalChange;
use super::prediction::{ExpectedStart, PredictedState};
use super::replanning::NextAttempt;
use super::situation::OverrunEstimate;
use super::snapshot::Goals;
use super::work_queue::PendingStep;
use super::{GoalStatus, Run, Stop, Verdict};
use crate::belief_state::BeliefState;
use crate::event::ActionHandle;
use crate::executor::PlanForm;
use crate::executor::StepId;
use crate::planning::{PlanAnswer, Planned};
use crate::reason::{Cause, Reason, Subject};
use crate::record::Entry;
use crate::request::{RequestId, Urgency};
use background_preparation::BackgroundPreparation;

/// Number of searches in a row that end at once when goals are abandoned. The next one continues
/// for a limited time ([`Run::search_time_limit`]), so that frequent changes of goals do not block
/// the run.
const MAX_ENDED_SEARCHES: usize = 3;

/// Minimum time for which a search may continue although its goals were abandoned, in seconds of
/// the world's clock. The time is at least twice the expected planning time. It doubles each time
/// that it passes before there is a plan.
const MIN_SEARCH_TIME: i64 = 5;

/// Maximum number of doublings of that time.
const MAX_DOUBLINGS: u32 = 20;

/// Maximum time for which a finished plan waits for the reports that commanded actions have
/// started, in seconds of the world's clock.
const MAX_START_REPORT_WAIT: i64 = 1;

/// Background search for a plan, until the plan takes over.
pub(super) struct BackgroundSearch {
    /// The request for the plan.
    request: RequestId,
    /// The answer, until it is processed.
    answer: Option<Planned>,
    pub(super) reason: Reason,
    guess: OverrunEstimate,
    /// The task, with the goals of the plan.
    task: Arc<Task>,
    /// These goals, as they were given.
    goals: Goals,
    /// The initial situation of the plan.
    situation: Situation,
    /// The actions running there. Tickets that were not issued when the search began are those of
    /// expected starts of the present plan.
    running: Vec<ActionHandle>,
    /// The expected starts of the present plan until then.
    expected: Vec<ExpectedStart>,
    started_at: Rational,
    /// The time of the forecast of its situation, which is before the start of the search if the
    /// situation was foreseen.
    since: Rational,
    /// `true` if the situation was foreseen, and the real one differed slightly when the search
    /// began.
    is_approximate: bool,
    execution: ExecutionDuringSearch,
    /// Number of timed initials after which the goal was last not known to be unreachable.
    timed: usize,
    has_finished: bool,
    /// `true` if an unexpected event has happened since.
    is_outdated: bool,
    /// The finished plan, and the time at which it was finished.
    plan: Option<(TimeTriggeredPlan, Rational)>,
    /// The preparation of the plan.
    preparation: Option<BackgroundPreparation>,
    /// Number of preparations so far.
    preparations: usize,
    /// The started steps of the earlier plan, once that plan was abandoned.
    abandoned_steps: BTreeMap<StepId, ActionHandle>,
    /// The change of the goals for which the plan is kept, if no other plan is searched for.
    kept_for_change: Option<PendingGoalChange>,
}

impl BackgroundSearch {
    /// Takes the answer to the request for the plan. If the run waits in the world, the answer is
    /// recorded at the end of the wait.
    pub(super) fn take_answer(&mut self, id: RequestId, planned: Planned, is_waiting: bool) {
        if id == self.request && self.answer.is_none() && !self.has_finished {
            self.answer = Some(planned);
            self.has_finished = !is_waiting;
        }
    }

    /// Returns `true` if the present plan continues unless the new one is better.
    pub(super) fn is_optional(&self) -> bool {
        self.reason.cause == Cause::MoreSlack
    }

    /// Returns `true` for each answer that has arrived and is not recorded yet: a plan, and a
    /// prepared plan.
    pub(super) fn arrived_answers(&self) -> (bool, bool) {
        let is_made = self.answer.is_some() && !self.has_finished;
        (
            is_made,
            self.preparation
                .as_ref()
                .is_some_and(BackgroundPreparation::has_arrived),
        )
    }

    /// Returns the request that has no answer yet.
    fn open_request(&self) -> Option<RequestId> {
        match &self.preparation {
            Some(readying) => readying.open_request(),
            None => (!self.has_finished && self.answer.is_none()).then_some(self.request),
        }
    }
}

/// Execution during a search.
#[derive(Clone, Debug, PartialEq, Eq)]
enum ExecutionDuringSearch {
    /// The present plan continues, until then if there is a limit.
    PlanContinues { until: Option<Rational> },
    /// Only the running actions continue.
    RunningActionsOnly,
}

/// Results of earlier searches, and state of the present plan, since a plan was last adopted.
#[derive(Clone, Debug, Default)]
pub(super) struct SearchResults {
    /// `true` if the present plan is infeasible.
    pub(super) is_plan_infeasible: bool,
    /// The last question to the world about doubts.
    pub(super) inquiry: DoubtInquiry,
    /// The plan that the executor abandoned, until another one is adopted.
    pub(super) abandoned: Option<AbandonedPlan>,
    /// The time at which no plan was found and the executor continued, and the verdict that applies
    /// if it stops; `None` after the next event.
    pub(super) failed_at: Option<(Rational, Verdict)>,
    /// `true` if a search for a better plan has used up its budget. No other one begins until there is a new plan.
    pub(super) has_better_search_failed: bool,
    /// `true` if goals were closed during the last search.
    pub(super) has_closed_goals: bool,
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

impl Run<'_> {
    /// Returns `true` if plans are made in the background from now on.
    pub(super) fn plans_aside(&self) -> bool {
        let has_begun = self.now.is_positive() || self.action_log.started() > 0;
        let is_waited_for = !has_begun && !self.becomes_idle_after(&Verdict::GoalReached);
        self.settings.plans_aside && !is_waited_for
    }

    /// Records that the planner has finished.
    pub(super) fn record_plan_finished(&mut self) -> Remark {
        match &mut self.search {
            Some(search) if !search.has_finished && search.answer.is_some() => {
                search.has_finished = true;
                None
            }
            _ => Some("no plan was being made"),
        }
    }

    /// Returns the belief with the goals of the present plan, which need not reach the goals that
    /// were given since. `None` if the goals are the same.
    pub(super) fn belief_of_the_plan(&self) -> Option<BeliefState> {
        let (_, task) = (self.search.as_ref()?, self.plan_task.as_ref()?);
        let mut belief = self.belief.clone();
        belief.set_goal(task);
        Some(belief)
    }

    /// Records that an unexpected event has happened.
    pub(super) fn record_unexpected_event(&mut self) {
        if let Some(search) = &mut self.search {
            search.is_outdated = true;
        }
        self.record_unexpected_event_for_preparation();
    }

    /// Begins a search when a plan is needed and the present one cannot continue.
    pub(super) fn search_from_here(&mut self, reason: &Reason) {
        self.abandon_plan();
        self.plan_events.clear();
        if !self.finish_if_goal_holds(reason) {
            self.search(
                reason.clone(),
                OverrunEstimate::QuarterLonger,
                ExecutionDuringSearch::RunningActionsOnly,
            );
        }
    }

    /// Begins a search because the goals have changed, while the present plan continues. Returns
    /// `false` if the plan cannot continue.
    pub(super) fn search_while_plan_continues(&mut self, reason: &Reason) -> Result<bool, Stop> {
        let goes_on = self.plans_aside()
            && self.settings.running == super::RunningRule::Keep
            && !self.search_results.is_plan_infeasible
            && self.present_plan().is_some()
            // These executors choose their own step numbers.
            && self.ports.executor.need() != PlanForm::PartialOrder
            && self.goal_status_without_plan().is_none_or(|it| it == GoalStatus::Unmet);
        if !goes_on {
            return Ok(false);
        }
        self.count_replan(reason)?;
        self.search(
            reason.clone(),
            OverrunEstimate::QuarterLonger,
            ExecutionDuringSearch::PlanContinues { until: None },
        );
        Ok(true)
    }

    /// Counts a new plan. Fails if the limit is reached.
    pub(super) fn count_replan(&mut self, reason: &Reason) -> Result<(), Stop> {
        self.reasons.push(reason.clone());
        self.replans += 1;
        if self.replans > self.settings.max_replans {
            self.replans -= 1;
            return Err(Stop::Ended(Verdict::ReplanLimit));
        }
        Ok(())
    }

    /// Begins a search for a plan.
    fn search(&mut self, reason: Reason, guess: OverrunEstimate, course: ExecutionDuringSearch) {
        let foreseen = match &course {
            ExecutionDuringSearch::PlanContinues { .. } => None,
            ExecutionDuringSearch::RunningActionsOnly => self.anticipated_situation(guess),
        };
        let ahead = foreseen.unwrap_or_else(|| AnticipatedSituation {
            prospect: match &course {
                ExecutionDuringSearch::PlanContinues { until } => {
                    self.expected_situation_after_planning(until.as_ref())
                }
                ExecutionDuringSearch::RunningActionsOnly => {
                    let (situation, running) = self.situation(&self.expected_planning_time, guess);
                    PredictedState {
                        situation,
                        running,
                        expected: Vec::new(),
                    }
                }
            },
            since: self.now.clone(),
            abandoned_steps: BTreeMap::new(),
            is_approximate: false,
        });
        let prospect = ahead.prospect;
        self.ports.recorder.record(&Entry::Planning {
            now: &self.now,
            reason: &reason,
            situation: &prospect.situation,
        });
        let request = self.request_plan(&prospect.situation, Urgency::Background);
        self.search = Some(BackgroundSearch {
            request,
            answer: None,
            reason,
            guess,
            task: Arc::clone(&self.task),
            goals: self.goals(),
            situation: prospect.situation,
            running: prospect.running,
            expected: prospect.expected,
            started_at: self.now.clone(),
            timed: self.belief.past_timed_initials(),
            since: ahead.since,
            is_approximate: ahead.is_approximate,
            execution: course,
            has_finished: false,
            is_outdated: false,
            plan: None,
            preparation: None,
            preparations: 0,
            abandoned_steps: ahead.abandoned_steps,
            kept_for_change: None,
        });
    }

    /// Searches for a better plan while the present one is executed.
    pub(super) fn search_for_a_better_plan(&mut self, reason: Reason) {
        let course = ExecutionDuringSearch::PlanContinues { until: None };
        self.search(reason, OverrunEstimate::QuarterLonger, course);
    }

    /// Ends the search if it is optional, that is, if the present plan continues without it.
    pub(super) fn cancel_optional_search(&mut self) {
        if self
            .search
            .as_ref()
            .is_some_and(BackgroundSearch::is_optional)
        {
            self.cancel_search();
        }
    }

    /// Ends a search whose plan is not needed any more.
    pub(super) fn cancel_search(&mut self) {
        if let Some(search) = self.search.take() {
            let open = search.open_request();
            if let Some(id) = open {
                self.abandon(id);
            }
        }
    }

    /// Abandons the present plan: none of its remaining steps is started.
    pub(super) fn abandon_plan(&mut self) {
        // It searched for a better plan than this one.
        self.cancel_optional_search();
        self.search_results.is_plan_infeasible = true;
        self.keep_forecast();
        if let Some(search) = &mut self.search {
            if search.execution != ExecutionDuringSearch::RunningActionsOnly {
                search.abandoned_steps = self.action_log.steps().clone();
            }
            search.execution = ExecutionDuringSearch::RunningActionsOnly;
        }
        self.detach_steps();
    }

    /// Returns the time of the next decision about the search if no event comes before.
    pub(super) fn next_search_decision(&self) -> Option<Rational> {
        let search = self.search.as_ref()?;
        let next = self.next_search_decision_of(search);
        if self.has_abandoned_goals() == Some(true) && !self.is_paused() {
            return Some(next.min(self.search_time_limit(search)));
        }
        Some(next)
    }

    fn next_search_decision_of(&self, search: &BackgroundSearch) -> Rational {
        if let Some(readying) = &search.preparation {
            return self.next_preparation_decision(readying);
        }
        if let Some((_, since)) = &search.plan {
            let at_least = &self.now + self.task.epsilon();
            let begins = search
                .situation
                .time
                .clone()
                .max(since + Rational::from(MAX_START_REPORT_WAIT));
            return begins.max(at_least);
        }
        match &search.execution {
            ExecutionDuringSearch::PlanContinues { until: Some(until) } => until.clone(),
            ExecutionDuringSearch::PlanContinues { until: None } => {
                self.settings.time_limit.clone()
            }
            // A deadline may pass before the planner answers.
            ExecutionDuringSearch::RunningActionsOnly => {
                let timed = self.belief.next_timed();
                let limit = &self.settings.time_limit;
                timed
                    .into_iter()
                    .chain([limit])
                    .min()
                    .unwrap_or(limit)
                    .clone()
            }
        }
    }

    /// Returns the time until which a search continues although its goals were abandoned.
    ///
    /// It is bounded because a search may never end. It grows with each such search, so that a plan
    /// can be finished even if the goals change all the time.
    fn search_time_limit(&self, search: &BackgroundSearch) -> Rational {
        let expected = &self.expected_planning_time * &Rational::from(2);
        let patience = expected.max(Rational::from(MIN_SEARCH_TIME));
        let doublings = self
            .search_results
            .ended_after_time_limit
            .min(MAX_DOUBLINGS);
        &search.started_at + patience * Rational::from(1_i64 << doublings)
    }

    /// Continues the search, if there is one. Returns `true` if the executor makes no decision
    /// because of it.
    pub(super) fn poll_planner(&mut self) -> Result<bool, Stop> {
        if self.is_goal_change_pending() {
            self.cancel_optional_search();
        }
        let Some(search) = self.search.as_ref() else {
            return Ok(false);
        };
        if self.is_goal_abandoned() {
            self.cancel_search();
            return Ok(false);
        }
        if self.is_paused() {
            return Ok(false);
        }
        if self.goal_status_without_plan() == Some(GoalStatus::Reached) {
            self.cancel_search();
            self.plan_events.clear();
            self.request_goal_look();
            return Ok(true);
        }
        let given_up = self.has_abandoned_goals();
        let is_let_go_on = self.search_results.ended_searches >= MAX_ENDED_SEARCHES;
        let is_to_end =
            given_up == Some(true) && (!is_let_go_on || self.now >= self.search_time_limit(search));
        if given_up.is_some() && (is_to_end || self.has_no_goals()) {
            self.search_results.ended_searches += 1;
            self.search_results.ended_after_time_limit += u32::from(is_let_go_on);
            self.cancel_search();
            return Ok(false);
        }
        if search.preparation.is_some() {
            return self.poll_preparation();
        }
        if search.plan.is_some() {
            return self.switch_if_due();
        }
        if search.has_finished {
            self.collect()?;
            return Ok(true);
        }
        if let ExecutionDuringSearch::PlanContinues { until: Some(until) } = &search.execution
            && self.now >= *until
        {
            self.abandon_plan();
        }
        self.restart_if_goals_unreachable();
        Ok(self.is_waiting_for_plan())
    }

    /// Restarts a search that has become futile because deadlines have passed since it began. From
    /// the present situation, that is proved at once, with a certificate.
    fn restart_if_goals_unreachable(&mut self) {
        let timed = self.belief.past_timed_initials();
        let Some(search) = self.search.as_mut().filter(|it| it.timed < timed) else {
            return;
        };
        search.timed = timed;
        if search.execution == ExecutionDuringSearch::RunningActionsOnly
            && is_goal_unreachable(&self.belief)
        {
            let (reason, guess) = (search.reason.clone(), search.guess);
            self.cancel_search();
            self.search(reason, guess, ExecutionDuringSearch::RunningActionsOnly);
        }
    }

    /// Waits for the plan if only running actions continue. Returns `true` if the run waits.
    fn is_waiting_for_plan(&mut self) -> bool {
        let search = self.search.as_ref();
        let waits = search
            .is_some_and(|search| search.execution == ExecutionDuringSearch::RunningActionsOnly);
        if waits {
            self.wait_for_search();
        }
        waits
    }

    /// Waits until the next decision about the search.
    fn wait_for_search(&mut self) {
        let timeout = self.next_timeout().into_iter();
        let until = timeout.chain(self.next_search_decision()).min();
        let until = until.unwrap_or_else(|| self.settings.time_limit.clone());
        self.work_queue.push(PendingStep::CheckTimeouts);
        self.work_queue
            .push(PendingStep::Wait(until.max(self.now.clone())));
    }

    /// Processes the planner's answer.
    fn collect(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.search.take() else {
            return Ok(());
        };
        let answer = search.answer.take();
        let Some(Planned {
            answer,
            remark,
            shortfall,
            ..
        }) = answer
        else {
            return Ok(());
        };
        let took = &self.now - &search.started_at;
        self.update_expected_planning_time(&took);
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
        self.note_shortfall(&search.goals, &shortfall);
        self.check_stop_request()?;
        match answer {
            PlanAnswer::Plan(_) if search.guess == OverrunEstimate::Cancelled => {
                self.cancel_overdue(search.reason);
                Ok(())
            }
            PlanAnswer::Plan(plan)
                if search.execution == ExecutionDuringSearch::RunningActionsOnly =>
            {
                search.plan = Some((plan.clone(), self.now.clone()));
                self.switch_from_empty_plan(search, &plan, true)
            }
            PlanAnswer::Plan(plan) => {
                search.plan = Some((plan, self.now.clone()));
                self.search = Some(search);
                Ok(())
            }
            answer if search.is_optional() => {
                self.note_no_better_plan(&answer);
                Ok(())
            }
            // Another plan is needed in any case.
            _ if self.is_goal_change_pending() => {
                if search.execution == ExecutionDuringSearch::RunningActionsOnly {
                    self.select_after_added_goals();
                }
                Ok(())
            }
            // There was no plan from that situation, but there may be one from the present one.
            _ if search.is_outdated => self.search_again(&search.reason),
            _ if search.execution != ExecutionDuringSearch::RunningActionsOnly
                && self.exclude_new_goals() =>
            {
                Ok(())
            }
            // The situation was only a forecast.
            _ if search.is_approximate
                || !search.expected.is_empty()
                || search.execution != ExecutionDuringSearch::RunningActionsOnly =>
            {
                self.search_from_here(&search.reason);
                Ok(())
            }
            answer => self.handle_missing_plan(&search, &answer),
        }
    }

    /// Handles the answer that no plan exists from a situation without further starts.
    fn handle_missing_plan(
        &mut self,
        search: &BackgroundSearch,
        answer: &PlanAnswer,
    ) -> Result<(), Stop> {
        let reason = search.reason.clone();
        match self.next_attempt(search.guess) {
            NextAttempt::Guess(guess) => {
                self.search(reason, guess, ExecutionDuringSearch::RunningActionsOnly);
            }
            NextAttempt::CancelOverdue => self.cancel_overdue(reason),
            NextAttempt::ContinuePlan => {
                return self.continue_or_stop_without_plan(answer, reason);
            }
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
        let reason = if self.is_goal_change_pending() {
            first
        } else {
            &reason
        };
        self.search_results.outdated_plans += 1;
        self.count_replan(reason)?;
        if self.search_results.outdated_plans > 1 || self.search_results.is_plan_infeasible {
            self.work_queue.push(PendingStep::Plan(reason.clone()));
            self.settle_running_actions();
            self.search_results.is_plan_infeasible = true;
            return Ok(());
        }
        // The search is expected to take about as long again.
        let ahead = &self.expected_planning_time * &Rational::new(3, 2);
        let until = Some(&self.now + ahead + self.task.epsilon());
        self.search(
            reason.clone(),
            OverrunEstimate::QuarterLonger,
            ExecutionDuringSearch::PlanContinues { until },
        );
        Ok(())
    }
}
