//! Requests for plans and prepared plans, and the continuations of the run when they are answered.

use std::collections::VecDeque;
use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::beginning::{Course, no_plan};
use super::handover::Attempt;
use super::lasting::Turn;
use super::search::Search;
use super::stand::Goals;
use super::{Next, Run, Stop};
use crate::event::{Event, Observation, Ticket};
use crate::executor::Mission;
use crate::planning::Planned;
use crate::preparation::PrepareError;
use crate::reason::Reason;
use crate::record::Entry;
use crate::request::{Answer, PlanRequest, PrepareRequest, RequestId, Urgency};

/// Continuation of the run when the awaited answer arrives.
pub(super) enum Pending {
    /// The answer is a plan.
    Plan(Attempt),
    /// The answer is a prepared plan.
    Preparation(Box<Preparation>),
}

/// Preparation of a plan for which the run waits.
pub(super) struct Preparation {
    plan: TimeTriggeredPlan,
    situation: Situation,
    running: Vec<Ticket>,
    /// The actions of the plan that have begun since.
    begun: Vec<Ticket>,
    /// The goals of the plan.
    goals: Goals,
    /// Continuation if the plan cannot be prepared.
    otherwise: Otherwise,
}

/// Continuation of the run if a plan cannot be prepared.
pub(super) enum Otherwise {
    /// The run ends.
    End,
    /// The plan was fitted to the present situation. Instead, the plan takes over as it was made,
    /// if possible.
    AsMade(Box<Search>, TimeTriggeredPlan),
    /// The plan of this search is outdated.
    SearchAgain(Box<Search>),
    /// The remaining plan was to be kept for other goals. Another plan is made.
    PlanForOthers(Turn),
    /// The present plan continues, also if the executor does not prefer the prepared one. The
    /// prepared plan was requested for this reason.
    Continue(Reason),
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
        if let Some(Next::Plan(request)) = &self.asked
            && request.id == id
        {
            self.asked = None;
            if let Some(Pending::Plan(attempt)) = self.pending.take()
                && let Err(stop) = self.take_plan(attempt, planned)
            {
                self.stop(stop);
            }
            return;
        }
        let is_waiting = matches!(self.asked, Some(Next::Wait { .. }));
        if let Some(search) = &mut self.search {
            search.take_answer(id, planned, is_waiting);
        }
    }

    /// Takes the answer to [`Next::Prepare`]. Answers to requests that are not open are ignored.
    ///
    /// An answer that arrives while the run waits in the world is recorded at the end of the wait
    /// ([`Event::PlanReady`]), at the present time; the driver can end the wait early.
    pub fn prepared(&mut self, id: RequestId, prepared: Result<Mission, PrepareError>) {
        if let Some(Next::Prepare(request)) = &self.asked
            && request.id == id
        {
            self.asked = None;
            if let Some(Pending::Preparation(preparation)) = self.pending.take()
                && let Err(stop) = self.take_preparation(*preparation, prepared)
            {
                self.stop(stop);
            }
            return;
        }
        let now = self.now.clone();
        let is_waiting = matches!(self.asked, Some(Next::Wait { .. }));
        if let Some(search) = &mut self.search {
            search.take_prepared(id, prepared, (!is_waiting).then_some(now));
        }
    }

    /// Returns the answers that arrived during the wait that ends at `now`, as observations.
    pub(super) fn arrivals(&self, now: &Rational) -> Vec<Observation> {
        let (is_made, is_ready) = self.search.as_ref().map_or((false, false), Search::arrived);
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
        self.asked = Some(Next::Plan(request));
        self.pending = Some(Pending::Plan(attempt));
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
        running: &[Ticket],
    ) -> RequestId {
        let request = self.preparation_of(
            task,
            Course::of(plan, situation, running),
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
        course: Course<'_>,
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
        course: Course<'_>,
        otherwise: Otherwise,
    ) {
        if self.settings.plans_aside {
            self.plan_task = Some(Arc::clone(task));
        }
        let request = self.preparation_of(task, course, Urgency::Awaited);
        self.asked = Some(Next::Prepare(request));
        self.pending = Some(Pending::Preparation(Box::new(Preparation {
            plan: course.plan.clone(),
            situation: course.situation.clone(),
            running: course.running.to_vec(),
            begun: course.begun.to_vec(),
            goals: goals.clone(),
            otherwise,
        })));
    }

    /// Begins with a prepared plan for which the run has waited.
    fn take_preparation(
        &mut self,
        preparation: Preparation,
        prepared: Result<Mission, PrepareError>,
    ) -> Result<(), Stop> {
        let mut mission = match prepared {
            Ok(mission) => mission,
            Err(error) => {
                return match preparation.otherwise {
                    Otherwise::End => Err(no_plan(&error)),
                    Otherwise::AsMade(search, plan) => self.take_over_as_made(*search, &plan),
                    Otherwise::SearchAgain(search) => self.search_again(&search.reason),
                    Otherwise::PlanForOthers(turn) => self.plan_for_others(&turn),
                    Otherwise::Continue(_) => Ok(()),
                };
            }
        };
        if let Otherwise::Continue(reason) = &preparation.otherwise
            && !self.takes_over(&mission, reason)?
        {
            return Ok(());
        }
        if let Otherwise::PlanForOthers(turn) = &preparation.otherwise {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &turn.reason,
            });
        }
        let steps = self.steps_of(&mission, &preparation.begun);
        mission.begun = steps.unwrap_or_default();
        let course = Course {
            plan: &preparation.plan,
            situation: &preparation.situation,
            running: &preparation.running,
            begun: &preparation.begun,
        };
        self.begin_with(course, &preparation.goals, &mission)
    }
}
