//! Background preparation of plans: execution meanwhile, and the switch to the new plan.
//!
//! A plan is prepared for a moment, with the actions running then. It takes over as if it had been
//! adopted at that moment, and its executor is notified at once of all starts and ends since. So
//! the executor's own checks of times and amounts decide whether the plan is still feasible.

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body};
use elbowroom_model::{Footprint, Situation, Step, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::super::persistent::PendingGoalChange;
use super::super::plan_start::{PlanStart, preparation_failure};
use super::super::{Run, Stop};
use super::fitting::StartedPlan;
use super::{BackgroundSearch, ExecutionDuringSearch, MAX_START_REPORT_WAIT};
use crate::event::{ActionHandle, Measured};
use crate::executor::{Order, PlanEvent, PlanForm, PreparedPlan};
use crate::preparation::PrepareError;
use crate::record::Entry;
use crate::request::RequestId;
use crate::run::observations::Remark;

/// Number of times that a plan is fitted and prepared again because of unexpected reports. After
/// that, its executor is notified of them, so that a run with frequent unexpected events does not
/// wait forever.
const MAX_FITTINGS: usize = 2;

/// Background preparation of a plan.
pub(super) struct BackgroundPreparation {
    request: RequestId,
    /// The prepared plan, until it is processed.
    answer: Option<Result<PreparedPlan, PrepareError>>,
    plan: TimeTriggeredPlan,
    /// The situation from which it starts.
    situation: Situation,
    /// The actions running there.
    running: Vec<ActionHandle>,
    /// Number of actions started until then. Later ones belong to the plan.
    started: usize,
    /// The time at which it was ready, if it is.
    since: Option<Rational>,
    /// `true` if an unexpected event has happened since.
    is_outdated: bool,
    /// `true` if the plan was fitted to the present situation.
    is_fitted: bool,
}

impl BackgroundPreparation {
    /// Returns `true` if the prepared plan has arrived, and is not recorded yet.
    pub(super) fn has_arrived(&self) -> bool {
        self.answer.is_some() && self.since.is_none()
    }

    /// Returns the request if it has no answer yet.
    pub(super) fn open_request(&self) -> Option<RequestId> {
        (self.answer.is_none() && self.since.is_none()).then_some(self.request)
    }
}

impl BackgroundSearch {
    /// Takes the answer to the request for a prepared plan. If the run waits in the world (`now` is `None`), the end
    /// of the wait notes it.
    pub(in crate::run) fn take_prepared(
        &mut self,
        id: RequestId,
        prepared: Result<PreparedPlan, PrepareError>,
        now: Option<Rational>,
    ) {
        if let Some(readying) = &mut self.preparation
            && readying.open_request() == Some(id)
        {
            readying.answer = Some(prepared);
            readying.since = now;
        }
    }
}

impl Run<'_> {
    /// Begins to prepare a fitted plan.
    pub(super) fn begin_preparation(
        &mut self,
        mut search: BackgroundSearch,
        fit: StartedPlan,
        is_fitted: bool,
    ) {
        let (plan, situation, running) = fit;
        let request = self.request_preparation(&search.task, &plan, &situation, &running);
        search.preparations += 1;
        search.preparation = Some(BackgroundPreparation {
            request,
            answer: None,
            plan,
            situation,
            running,
            started: self.action_log.started(),
            since: None,
            is_outdated: false,
            is_fitted,
        });
        self.search = Some(search);
    }

    /// Records that the plan is prepared.
    pub(in crate::run) fn note_plan_ready(&mut self) -> Remark {
        let search = self.search.as_mut();
        match search.and_then(|search| search.preparation.as_mut()) {
            Some(readying) if readying.since.is_none() && readying.answer.is_some() => {
                readying.since = Some(self.now.clone());
                None
            }
            _ => Some("no plan was being prepared"),
        }
    }

    /// Records an event that the plan being prepared does not account for.
    pub(in crate::run) fn record_unexpected_event_for_preparation(&mut self) {
        self.record_unforeseen_event();
        let search = self.search.as_mut();
        if let Some(readying) = search.and_then(|search| search.preparation.as_mut()) {
            readying.is_outdated = true;
        }
    }

    /// Records that amounts were measured. The executor of the next plan does not receive them,
    /// only the resulting values.
    pub(in crate::run) fn note_measured(&mut self, measured: &[Measured]) {
        if !measured.is_empty() {
            self.record_unexpected_event_for_preparation();
        }
    }

    /// Returns the time of the next decision about the preparation if no event comes before.
    pub(super) fn next_preparation_decision(&self, readying: &BackgroundPreparation) -> Rational {
        match &readying.since {
            Some(since) => {
                (since + Rational::from(MAX_START_REPORT_WAIT)).max(&self.now + self.task.epsilon())
            }
            None if self.now < readying.situation.time => readying.situation.time.clone(),
            // The preparer reports when it is finished.
            None => self.settings.time_limit.clone(),
        }
    }

    /// Returns `true` if these actions can be started while a plan is being prepared: the plan also
    /// has them, and no earlier step of it interferes with them.
    pub(in crate::run) fn may_start(&self, orders: &[Order]) -> bool {
        let readying = self.search.as_ref().and_then(|it| it.preparation.as_ref());
        let Some(readying) = readying else {
            return true;
        };
        let mut left = Step::by_start(readying.plan.new_steps(&readying.situation));
        let begun = starts_since(readying, self.action_log.started());
        let begun = begun.filter_map(|it| self.action_log.get(it));
        let mut take = |name: &str| {
            let index = left.iter().position(|it| it.action.name == name)?;
            Some(left.remove(index))
        };
        if !begun.map(|it| take(&it.action.name)).all(|it| it.is_some()) {
            return false;
        }
        let starts: Option<Vec<&Step>> = orders.iter().map(|it| take(&it.action.name)).collect();
        starts.is_some_and(|starts| {
            starts.iter().all(|step| {
                let mut earlier = left.iter().filter(|it| it.start < step.start);
                !earlier.any(|it| may_interfere(&self.task, &it.action, &step.action))
            })
        })
    }

    /// Continues a preparation. Returns `true` if the executor makes no decision now.
    pub(super) fn poll_preparation(&mut self) -> Result<bool, Stop> {
        let Some(search) = &self.search else {
            return Ok(false);
        };
        let Some(readying) = &search.preparation else {
            return Ok(false);
        };
        let Some(since) = &readying.since else {
            let goes_on = search.execution != ExecutionDuringSearch::RunningActionsOnly;
            // No step of the plan begins before its start time.
            if goes_on && self.now >= readying.situation.time {
                return Ok(false);
            }
            self.wait_for_search();
            return Ok(true);
        };
        if self.has_unreported_start(readying)
            && self.now < since + Rational::from(MAX_START_REPORT_WAIT)
        {
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

    /// Returns `true` if an action was started meanwhile and its start has not been reported.
    fn has_unreported_start(&self, readying: &BackgroundPreparation) -> bool {
        let has_ended =
            |it: ActionHandle| self.action_log.get(it).is_none_or(|it| it.ended.is_some());
        let mut begun = starts_since(readying, self.action_log.started());
        begun.any(|it| !has_ended(it) && !self.belief.running().contains_key(&it))
    }

    /// Switches to a prepared plan if the events meanwhile were as expected.
    fn switch_to_prepared(&mut self) -> Result<(), Stop> {
        let Some(mut search) = self.search.take() else {
            return Ok(());
        };
        let Some(mut readying) = search.preparation.take() else {
            return Ok(());
        };
        let Some(mission) = readying.answer.take() else {
            return Ok(());
        };
        self.check_stop_request()?;
        let begun: Vec<ActionHandle> = starts_since(&readying, self.action_log.started()).collect();
        let mut mission = match mission {
            Ok(mission) => mission,
            Err(error) => {
                if let Some(turn) = search.kept_for_change.take() {
                    return self.replan_for_changed_goals(&turn);
                }
                if search.is_optional() {
                    return Ok(());
                }
                if search.execution != ExecutionDuringSearch::RunningActionsOnly
                    || !begun.is_empty()
                {
                    return self.search_again(&search.reason);
                }
                if !readying.is_fitted {
                    return Err(preparation_failure(&error));
                }
                let plan = search.plan.as_ref().map(|(plan, _)| plan.clone());
                return match plan {
                    Some(plan) => self.switch_from_empty_plan(search, &plan, false),
                    None => Err(preparation_failure(&error)),
                };
            }
        };
        let steps = self.match_steps(&mission, &begun);
        let agrees =
            !readying.is_outdated && !self.has_unreported_start(&readying) && steps.is_some();
        if search.is_optional() {
            if !agrees || !self.replaces_present_plan(&mission, &search.reason)? {
                return Ok(());
            }
        } else if !agrees && (search.preparations <= MAX_FITTINGS || !begun.is_empty()) {
            search = match self.refit(search)? {
                // Its executor is notified instead.
                Some(search) if begun.is_empty() => search,
                Some(search) => return self.search_again(&search.reason),
                None => return Ok(()),
            };
        }
        if let Some(turn) = &search.kept_for_change {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &turn.reason,
            });
        } else {
            let took = &self.now - &search.started_at;
            self.expected_planning_time =
                std::mem::take(&mut self.expected_planning_time).max(took);
        }
        self.report_past_events();
        self.plan_task = Some(Arc::clone(&search.task));
        mission.begun = steps.unwrap_or_default();
        mission.now.clone_from(&self.now);
        let course = PlanStart {
            plan: &readying.plan,
            situation: &readying.situation,
            running: &readying.running,
            begun_steps: &begun,
        };
        self.begin_prepared_plan_for_goals(course, &search.goals, &mission)
    }

    /// Fits the plan again after unexpected events during its preparation, or requests another one.
    /// Returns the search if the executor of the plan is to be notified instead.
    fn refit(&mut self, mut search: BackgroundSearch) -> Result<Option<BackgroundSearch>, Stop> {
        if let Some(turn) = search.kept_for_change.take() {
            self.refit_remaining_plan(turn)?;
            return Ok(None);
        }
        let went_on = search.execution != ExecutionDuringSearch::RunningActionsOnly;
        self.search = Some(search);
        if went_on {
            self.abandon_plan();
        }
        let Some(search) = self.search.take() else {
            return Ok(None);
        };
        let plan = search.plan.as_ref().map(|(plan, _)| plan);
        if let Some(fit) = plan.and_then(|plan| self.fit_to_present(&search, plan)) {
            self.plan_events.clear();
            self.begin_preparation(search, fit, true);
            return Ok(None);
        }
        if went_on || !search.expected.is_empty() {
            self.search_again(&search.reason)?;
            return Ok(None);
        }
        Ok(Some(search))
    }

    /// Prepares the remaining plan for other goals.
    pub(in crate::run) fn prepare_remaining_plan(
        &mut self,
        turn: PendingGoalChange,
        rest: StartedPlan,
    ) {
        let may_go_on = !self.search_results.is_plan_infeasible
            && self.settings.running == super::super::RunningRule::Keep
            && self.ports.executor.need() != PlanForm::PartialOrder;
        let search = BackgroundSearch {
            request: self.next_request(),
            answer: None,
            reason: turn.reason.clone(),
            guess: super::OverrunEstimate::QuarterLonger,
            task: Arc::clone(&self.task),
            goals: self.goals(),
            situation: rest.1.clone(),
            running: rest.2.clone(),
            expected: Vec::new(),
            started_at: self.now.clone(),
            timed: self.belief.past_timed_initials(),
            since: self.now.clone(),
            is_approximate: false,
            execution: ExecutionDuringSearch::PlanContinues { until: None },
            has_finished: true,
            is_outdated: false,
            plan: None,
            preparation: None,
            preparations: 0,
            abandoned_steps: std::collections::BTreeMap::new(),
            kept_for_change: Some(turn),
        };
        self.begin_preparation(search, rest, true);
        if !may_go_on {
            self.abandon_plan();
        }
    }

    /// Fits the remaining plan again because it is outdated, or makes another plan.
    fn refit_remaining_plan(&mut self, turn: PendingGoalChange) -> Result<(), Stop> {
        self.search_results.outdated_kept_plans += 1;
        if self.search_results.outdated_kept_plans > MAX_FITTINGS {
            return self.replan_for_changed_goals(&turn);
        }
        self.requeue_goal_change(turn);
        Ok(())
    }

    /// Detaches the started actions from the steps of the present plan. Their effects are reported
    /// as news.
    pub(in crate::run) fn detach_steps(&mut self) {
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
        self.action_log
            .begin_plan(&std::collections::BTreeMap::new());
    }
}

/// Returns the starts since the preparation began.
fn starts_since(
    readying: &BackgroundPreparation,
    started: usize,
) -> impl Iterator<Item = ActionHandle> + use<> {
    (readying.started..started).map(|number| ActionHandle(number as u64))
}

/// Returns `true` if the order of two actions may matter.
fn may_interfere(task: &Task, one: &Action, other: &Action) -> bool {
    let prints = |action: &Action| {
        let mut all = vec![
            Footprint::of_start(task, action),
            Footprint::of_end(task, action),
        ];
        if let Body::Durative(body) = &action.body {
            all.push(Footprint::of_condition(task, &body.over_all));
        }
        all
    };
    let others = prints(other);
    let touches = |it: &Footprint| others.iter().any(|other| it.interferes_with(other));
    prints(one).iter().any(touches)
}
