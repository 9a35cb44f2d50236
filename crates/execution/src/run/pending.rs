//! Requests for plans and prepared plans, and the continuations of the run when they are answered.

use std::collections::VecDeque;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::background_search::BackgroundSearch;
use super::persistent::PendingGoalChange;
use super::plan_start::{PlanStart, preparation_failure};
use super::replanning::Attempt;
use super::snapshot::Goals;
use super::{Next, Run, Stop};
use crate::event::{ActionHandle, Event, Observation};
use crate::executor::PreparedPlan;
use crate::planning::Planned;
use crate::preparation::PrepareError;
use crate::reason::Reason;
use crate::record::Entry;
use crate::request::{Answer, PlanRequest, PrepareRequest, RequestId, Urgency};

/// Continuation of the run when the awaited answer arrives.
pub(super) enum AwaitedAnswer {
    /// The answer is a plan.
    Plan(Attempt),
    /// The answer is a prepared plan.
    Preparation(Box<Preparation>),
}

/// Preparation of a plan for which the run waits.
pub(super) struct Preparation {
    plan: TimeTriggeredPlan,
    situation: Situation,
    running: Vec<ActionHandle>,
    /// The actions of the plan that have begun since.
    begun_steps: Vec<ActionHandle>,
    /// The goals of the plan.
    goals: Goals,
    /// Continuation if the plan cannot be prepared.
    fallback: PreparationFallback,
}

/// Continuation of the run if a plan cannot be prepared.
pub(super) enum PreparationFallback {
    /// The run ends.
    EndRun,
    /// The plan was fitted to the present situation. Instead, the plan takes over as it was made,
    /// if possible.
    AdoptUnfitted(Box<BackgroundSearch>, TimeTriggeredPlan),
    /// The plan of this search is outdated.
    SearchAgain(Box<BackgroundSearch>),
    /// The remaining plan was to be kept for other goals. Another plan is made.
    ReplanForGoals(PendingGoalChange),
    /// The present plan continues, even if the executor does not prefer the prepared one. The
    /// prepared plan was requested for this reason.
    ContinuePlan(Reason),
}

impl Run<'_> {
    /// Returns the identifier of the next request.
    pub(super) fn next_request(&mut self) -> RequestId {
        self.requests += 1;
        RequestId(self.requests)
    }

    /// Takes the answer to a background request.
    pub fn answer(&mut self, answer: Answer) {
        match answer {
            Answer::Planned(id, planned) => self.planned(id, planned),
            Answer::Prepared(id, prepared) => self.prepared(id, prepared),
        }
    }

    /// Takes the answer to [`Next::Plan`]. Answers to requests that are not open are ignored.
    ///
    /// An answer that arrives while the run waits in the world is recorded at the end of the wait
    /// ([`Event::PlanMade`]), at the present time; the driver can end the wait early.
    pub fn planned(&mut self, id: RequestId, planned: Planned) {
        if let Some(Next::Plan(request)) = &self.open_request
            && request.id == id
        {
            self.open_request = None;
            if let Some(AwaitedAnswer::Plan(attempt)) = self.pending.take()
                && let Err(stop) = self.process_planner_answer(attempt, planned)
            {
                self.begin_shutdown(stop);
            }
            return;
        }
        let is_waiting = matches!(self.open_request, Some(Next::Wait { .. }));
        if let Some(search) = &mut self.search {
            search.take_answer(id, planned, is_waiting);
        }
    }

    /// Takes the answer to [`Next::Prepare`]. Answers to requests that are not open are ignored.
    ///
    /// An answer that arrives while the run waits in the world is recorded at the end of the wait
    /// ([`Event::PlanReady`]), at the present time; the driver can end the wait early.
    pub fn prepared(&mut self, id: RequestId, prepared: Result<PreparedPlan, PrepareError>) {
        if let Some(Next::Prepare(request)) = &self.open_request
            && request.id == id
        {
            self.open_request = None;
            if let Some(AwaitedAnswer::Preparation(preparation)) = self.pending.take()
                && let Err(stop) = self.take_preparation(*preparation, prepared)
            {
                self.begin_shutdown(stop);
            }
            return;
        }
        let now = self.now.clone();
        let is_waiting = matches!(self.open_request, Some(Next::Wait { .. }));
        if let Some(search) = &mut self.search {
            search.take_prepared(id, prepared, (!is_waiting).then_some(now));
        }
    }

    /// Returns the answers that arrived during the wait that ends at `now`, as observations.
    pub(super) fn take_arrived_answers(&self, now: &Rational) -> Vec<Observation> {
        let (is_made, is_ready) = self
            .search
            .as_ref()
            .map_or((false, false), BackgroundSearch::arrived_answers);
        let made = is_made.then_some(Event::PlanMade);
        let ready = is_ready.then_some(Event::PlanReady);
        let events = made.into_iter().chain(ready);
        let arrival = |event| Observation {
            time: now.clone(),
            event,
        };
        events.map(arrival).collect()
    }

    /// Requests a plan, for which the run waits.
    pub(super) fn await_plan(&mut self, attempt: Attempt) {
        let request = PlanRequest {
            id: self.next_request(),
            task: Arc::clone(&self.task),
            situation: attempt.situation.clone(),
            urgency: Urgency::Awaited,
        };
        self.open_request = Some(Next::Plan(request));
        self.pending = Some(AwaitedAnswer::Plan(attempt));
    }

    /// Requests a plan without waiting for it.
    pub(super) fn request_plan(&mut self, situation: &Situation, urgency: Urgency) -> RequestId {
        let id = self.next_request();
        self.outbox.push_back(Next::Plan(PlanRequest {
            id,
            task: Arc::clone(&self.task),
            situation: situation.clone(),
            urgency,
        }));
        id
    }

    /// Requests a prepared plan without waiting for it.
    pub(super) fn request_preparation(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        situation: &Situation,
        running: &[ActionHandle],
    ) -> RequestId {
        let request = self.preparation_of(
            task,
            PlanStart::of(plan, situation, running),
            Urgency::Background,
        );
        let id = request.id;
        self.outbox.push_back(Next::Prepare(request));
        id
    }

    /// Abandons a request.
    pub(super) fn abandon(&mut self, id: RequestId) {
        let before = self.outbox.len();
        let is_it = |next: &Next| match next {
            Next::Plan(request) => request.id == id,
            Next::Prepare(request) => request.id == id,
            _ => false,
        };
        let others = self.outbox.drain(..).filter(|next| !is_it(next));
        self.outbox = others.collect::<VecDeque<_>>();
        if self.outbox.len() == before {
            self.outbox.push_back(Next::Abandon(id));
        }
    }

    fn preparation_of(
        &mut self,
        task: &Arc<Task>,
        course: PlanStart<'_>,
        urgency: Urgency,
    ) -> PrepareRequest {
        PrepareRequest {
            id: self.next_request(),
            task: Arc::clone(task),
            plan: course.plan.clone(),
            situation: course.situation.clone(),
            running: course.running.to_vec(),
            now: self.now.clone(),
            need: self.ports.executor.need(),
            urgency,
        }
    }

    /// Requests a prepared plan for these goals, which belong to the task, and begins with it when
    /// it arrives.
    pub(super) fn await_preparation(
        &mut self,
        task: &Arc<Task>,
        goals: &Goals,
        course: PlanStart<'_>,
        otherwise: PreparationFallback,
    ) {
        if self.settings.plans_aside {
            self.plan_task = Some(Arc::clone(task));
        }
        let request = self.preparation_of(task, course, Urgency::Awaited);
        self.open_request = Some(Next::Prepare(request));
        self.pending = Some(AwaitedAnswer::Preparation(Box::new(Preparation {
            plan: course.plan.clone(),
            situation: course.situation.clone(),
            running: course.running.to_vec(),
            begun_steps: course.begun_steps.to_vec(),
            goals: goals.clone(),
            fallback: otherwise,
        })));
    }

    /// Begins with a prepared plan for which the run has waited.
    fn take_preparation(
        &mut self,
        preparation: Preparation,
        prepared: Result<PreparedPlan, PrepareError>,
    ) -> Result<(), Stop> {
        let mut mission = match prepared {
            Ok(mission) => mission,
            Err(error) => {
                return match preparation.fallback {
                    PreparationFallback::EndRun => Err(preparation_failure(&error)),
                    PreparationFallback::AdoptUnfitted(search, plan) => {
                        self.switch_unfitted(*search, &plan)
                    }
                    PreparationFallback::SearchAgain(search) => self.search_again(&search.reason),
                    PreparationFallback::ReplanForGoals(turn) => {
                        self.replan_for_changed_goals(&turn)
                    }
                    PreparationFallback::ContinuePlan(_) => Ok(()),
                };
            }
        };
        if let PreparationFallback::ContinuePlan(reason) = &preparation.fallback
            && !self.replaces_present_plan(&mission, reason)?
        {
            return Ok(());
        }
        if let PreparationFallback::ReplanForGoals(turn) = &preparation.fallback {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &turn.reason,
            });
        }
        let steps = self.match_steps(&mission, &preparation.begun_steps);
        mission.begun = steps.unwrap_or_default();
        let course = PlanStart {
            plan: &preparation.plan,
            situation: &preparation.situation,
            running: &preparation.running,
            begun_steps: &preparation.begun_steps,
        };
        self.begin_prepared_plan_for_goals(course, &preparation.goals, &mission)
    }
}
