//! A search for a plan in the background, until the plan takes over.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::{Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::preparation::Preparation;
use crate::event::ActionHandle;
use crate::executor::{PreparedPlan, StepId};
use crate::planning::Planned;
use crate::preparation::PrepareError;
use crate::reason::{Cause, Reason};
use crate::request::RequestId;
use crate::run::goals::{Goals, PendingGoalChange};
use crate::run::situation::{OverrunEstimate, StartedPlan};
use crate::run::view::{ExpectedStart, PredictedState, RunView};

/// Maximum time for which a finished plan waits for the reports that commanded actions have
/// started, in seconds of the world's clock.
pub(in crate::run) const MAX_START_REPORT_WAIT: i64 = 1;

/// The question that a search answers.
pub(in crate::run) struct PlanQuery {
    pub(in crate::run) reason: Reason,
    pub(in crate::run) guess: OverrunEstimate,
    /// The task, with the goals of the plan.
    pub(in crate::run) task: Arc<Task>,
    /// These goals, as they were given.
    pub(in crate::run) goals: Goals,
    /// The initial situation of the plan. Tickets of its running actions that were not issued when
    /// the search began are those of expected starts of the present plan.
    pub(in crate::run) start: PredictedState,
    pub(in crate::run) started_at: Rational,
    /// The time of the forecast of the situation, which is before the start of the search if the
    /// situation was foreseen.
    pub(in crate::run) since: Rational,
    /// `true` if the situation was foreseen, and the real one differed slightly when the search
    /// began.
    pub(in crate::run) is_approximate: bool,
}

/// Execution during a search.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(in crate::run) enum ExecutionDuringSearch {
    /// The present plan continues, until then if there is a limit.
    PlanContinues { until: Option<Rational> },
    /// Only the running actions continue.
    RunningActionsOnly,
}

/// Background search for a plan, until the plan takes over.
pub(in crate::run) struct BackgroundSearch {
    query: PlanQuery,
    /// The request for the plan.
    request: RequestId,
    /// The answer, until it is processed.
    answer: Option<Planned>,
    execution: ExecutionDuringSearch,
    /// Number of timed initials after which the goal was last not known to be unreachable.
    timed: usize,
    has_finished: bool,
    /// `true` if an unexpected event has happened since.
    is_outdated: bool,
    /// The finished plan, and the time at which it was finished.
    plan: Option<(TimeTriggeredPlan, Rational)>,
    /// The preparation of the plan.
    preparation: Option<Preparation>,
    /// Number of preparations so far.
    preparations: usize,
    /// The started steps of the earlier plan, once that plan was abandoned.
    abandoned_steps: BTreeMap<StepId, ActionHandle>,
    /// The change of the goals for which the plan is kept, if no other plan is searched for.
    kept_for_change: Option<PendingGoalChange>,
}

impl BackgroundSearch {
    /// Begins a search. `timed` is the number of past timed initials; `abandoned_steps` are the
    /// started steps of the plan that was abandoned before.
    pub(in crate::run) fn new(
        query: PlanQuery,
        request: RequestId,
        execution: ExecutionDuringSearch,
        timed: usize,
        abandoned_steps: BTreeMap<StepId, ActionHandle>,
    ) -> Self {
        Self {
            query,
            request,
            answer: None,
            execution,
            timed,
            has_finished: false,
            is_outdated: false,
            plan: None,
            preparation: None,
            preparations: 0,
            abandoned_steps,
            kept_for_change: None,
        }
    }

    /// Makes it a search that is finished, because a plan is kept for other goals.
    pub(in crate::run) fn keeping_plan(mut self, change: PendingGoalChange) -> Self {
        self.has_finished = true;
        self.kept_for_change = Some(change);
        self
    }

    pub(in crate::run) fn query(&self) -> &PlanQuery {
        &self.query
    }

    /// Takes the answer to the request for the plan. If the run waits in the world, the answer is
    /// recorded at the end of the wait.
    pub(in crate::run) fn take_answer(
        &mut self,
        id: RequestId,
        planned: Planned,
        is_waiting: bool,
    ) {
        if id == self.request && self.answer.is_none() && !self.has_finished {
            self.answer = Some(planned);
            self.has_finished = !is_waiting;
        }
    }

    /// Takes the answer to the request for a prepared plan. If the run waits in the world (`now` is
    /// `None`), the end of the wait notes it.
    pub(in crate::run) fn take_prepared(
        &mut self,
        id: RequestId,
        prepared: Result<PreparedPlan, PrepareError>,
        now: Option<Rational>,
    ) {
        if let Some(preparation) = &mut self.preparation {
            preparation.take_answer(id, prepared, now);
        }
    }

    /// Records that the planner has finished. Returns `false` if no plan was being made.
    pub(in crate::run) fn note_finished(&mut self) -> bool {
        let is_new = !self.has_finished && self.answer.is_some();
        self.has_finished |= is_new;
        is_new
    }

    /// Records that the plan is prepared. Returns `false` if no plan was being prepared.
    pub(in crate::run) fn note_ready(&mut self, now: &Rational) -> bool {
        let preparation = self.preparation.as_mut();
        preparation.is_some_and(|it| it.note_ready(now))
    }

    /// Returns `true` if the present plan continues unless the new one is better.
    pub(in crate::run) fn is_optional(&self) -> bool {
        self.query.reason.cause == Cause::MoreSlack
    }

    /// Returns `true` for each answer that has arrived and is not recorded yet: a plan, and a
    /// prepared plan.
    pub(super) fn arrived_answers(&self) -> (bool, bool) {
        let is_made = self.answer.is_some() && !self.has_finished;
        let preparation = self.preparation.as_ref();
        (is_made, preparation.is_some_and(Preparation::has_arrived))
    }

    /// Returns the request that has no answer yet.
    pub(super) fn open_request(&self) -> Option<RequestId> {
        match &self.preparation {
            Some(preparation) => preparation.open_request(),
            None => (!self.has_finished && self.answer.is_none()).then_some(self.request),
        }
    }

    pub(super) fn note_unexpected_event(&mut self) {
        self.is_outdated = true;
    }

    /// Records an event that the plan being prepared does not account for.
    pub(super) fn note_unexpected_effects(&mut self) {
        if let Some(preparation) = &mut self.preparation {
            preparation.note_unexpected_event();
        }
    }

    pub(in crate::run) fn is_outdated(&self) -> bool {
        self.is_outdated
    }

    pub(in crate::run) fn has_finished(&self) -> bool {
        self.has_finished
    }

    pub(in crate::run) fn take_finished(&mut self) -> Option<Planned> {
        self.answer.take()
    }

    /// Returns `true` if only running actions continue, `false` if the present plan does.
    pub(in crate::run) fn has_abandoned_plan(&self) -> bool {
        self.execution == ExecutionDuringSearch::RunningActionsOnly
    }

    /// Returns `true` if the present plan has continued for as long as it was to continue.
    pub(in crate::run) fn is_plan_to_stop(&self, now: &Rational) -> bool {
        matches!(&self.execution, ExecutionDuringSearch::PlanContinues { until: Some(until) } if now >= until)
    }

    /// Abandons the present plan. These of its steps were started.
    pub(super) fn abandon_plan(&mut self, started: &BTreeMap<StepId, ActionHandle>) {
        if !self.has_abandoned_plan() {
            self.abandoned_steps.clone_from(started);
            self.execution = ExecutionDuringSearch::RunningActionsOnly;
        }
    }

    pub(super) fn abandoned_steps(&self) -> &BTreeMap<StepId, ActionHandle> {
        &self.abandoned_steps
    }

    /// Returns `true` if timed initials have happened since the last call, while only running
    /// actions continue. `timed` is their number.
    pub(in crate::run) fn may_be_futile(&mut self, timed: usize) -> bool {
        let is_later = self.timed < timed;
        self.timed = self.timed.max(timed);
        is_later && self.has_abandoned_plan()
    }

    pub(in crate::run) fn plan(&self) -> Option<&(TimeTriggeredPlan, Rational)> {
        self.plan.as_ref()
    }

    pub(in crate::run) fn set_plan(&mut self, plan: TimeTriggeredPlan, now: &Rational) {
        self.plan = Some((plan, now.clone()));
    }

    pub(in crate::run) fn preparation(&self) -> Option<&Preparation> {
        self.preparation.as_ref()
    }

    pub(in crate::run) fn take_preparation(&mut self) -> Option<Preparation> {
        self.preparation.take()
    }

    /// Begins to prepare a plan. `started` is the number of actions started so far.
    pub(in crate::run) fn prepare(
        &mut self,
        request: RequestId,
        course: StartedPlan,
        started: usize,
        is_fitted: bool,
    ) {
        self.preparations += 1;
        let preparation = Preparation::new(request, course, started, is_fitted);
        self.preparation = Some(preparation);
    }

    pub(in crate::run) fn preparations(&self) -> usize {
        self.preparations
    }

    pub(in crate::run) fn kept_for_change(&self) -> Option<&PendingGoalChange> {
        self.kept_for_change.as_ref()
    }

    pub(in crate::run) fn take_kept_for_change(&mut self) -> Option<PendingGoalChange> {
        self.kept_for_change.take()
    }

    /// Returns `true` if the finished plan is to take over, except for commanded actions whose
    /// start has not been reported: a plan cannot include these.
    pub(in crate::run) fn is_switch_due(&self, view: &RunView<'_>) -> bool {
        let Some((_, since)) = &self.plan else {
            return false;
        };
        let is_begun = |it: &ExpectedStart| view.log.ticket(it.step).is_some();
        // With background preparation, steps that have not begun are part of the prepared plan.
        let is_due = view.settings.prepares_in_background
            || *view.now >= self.query.start.situation.time
            || self.query.start.expected.iter().all(is_begun);
        let waits_for_report = !view.are_all_starts_reported()
            && *view.now < since + Rational::from(MAX_START_REPORT_WAIT);
        self.has_abandoned_plan() || (is_due && !waits_for_report)
    }

    /// Returns the time of the next decision about the search if no event comes before.
    pub(in crate::run) fn next_decision(&self, view: &RunView<'_>) -> Rational {
        if let Some(preparation) = &self.preparation {
            return preparation.next_decision(view);
        }
        if let Some((_, since)) = &self.plan {
            let at_least = view.now + view.task.epsilon();
            let reported = since + Rational::from(MAX_START_REPORT_WAIT);
            let begins = self.query.start.situation.time.clone().max(reported);
            return begins.max(at_least);
        }
        let limit = &view.settings.time_limit;
        match &self.execution {
            ExecutionDuringSearch::PlanContinues { until } => until.as_ref().unwrap_or(limit),
            // A deadline may pass before the planner answers.
            ExecutionDuringSearch::RunningActionsOnly => {
                let timed = view.belief.next_timed();
                timed.map_or(limit, |timed| timed.min(limit))
            }
        }
        .clone()
    }
}
