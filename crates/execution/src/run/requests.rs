//! Requests for plans and prepared plans, and their answers.

use std::sync::Arc;

use elbowroom_model::{Situation, Task};

use super::agenda::{Attempt, AwaitedAnswer, AwaitedPreparation, Next, PreparationFallback};
use super::goals::Goals;
use super::plan_start::{PlanStart, preparation_failure};
use super::{Run, Stop};
use crate::executor::PreparedPlan;
use crate::planning::Planned;
use crate::preparation::PrepareError;
use crate::record::Entry;
use crate::request::{Answer, PlanRequest, PrepareRequest, RequestId, Urgency};

impl Run<'_> {
    /// Takes the answer to a background request.
    pub fn answer(&mut self, answer: Answer) {
        match answer {
            Answer::Planned(id, planned) => self.planned(id, planned),
            Answer::Prepared(id, prepared) => self.prepared(id, prepared),
        }
    }

    /// Takes the answer to [`Next::Plan`]. Answers to requests that are not open are ignored. After
    /// a stop request, an awaited answer is ignored as well: it may be incomplete.
    ///
    /// An answer that arrives while the run waits in the world is recorded at the end of the wait
    /// ([`Event::PlanMade`](crate::Event::PlanMade)), at the present time; the driver can end the
    /// wait early.
    pub fn planned(&mut self, id: RequestId, planned: Planned) {
        if let Some(attempt) = self.agenda.answer_plan(id) {
            let processed = self
                .check_stop_request()
                .and_then(|()| self.process_planner_answer(attempt, planned));
            if let Err(stop) = processed {
                self.begin_shutdown(stop);
            }
            return;
        }
        let is_waiting = self.agenda.is_waiting();
        if let Some(search) = self.background.search_mut() {
            search.take_answer(id, planned, is_waiting);
        }
    }

    /// Takes the answer to [`Next::Prepare`]. Answers to requests that are not open are ignored.
    /// After a stop request, an awaited answer is ignored as well: it may be incomplete.
    ///
    /// An answer that arrives while the run waits in the world is recorded at the end of the wait
    /// ([`Event::PlanReady`](crate::Event::PlanReady)), at the present time; the driver can end the
    /// wait early.
    pub fn prepared(&mut self, id: RequestId, prepared: Result<PreparedPlan, PrepareError>) {
        if let Some(preparation) = self.agenda.answer_preparation(id) {
            let taken = self
                .check_stop_request()
                .and_then(|()| self.take_preparation(*preparation, prepared));
            if let Err(stop) = taken {
                self.begin_shutdown(stop);
            }
            return;
        }
        let now = (!self.agenda.is_waiting()).then(|| self.now.clone());
        if let Some(search) = self.background.search_mut() {
            search.take_prepared(id, prepared, now);
        }
    }

    /// Requests a plan, for which the run waits.
    pub(super) fn await_plan(&mut self, attempt: Attempt) {
        let request = self.plan_request(&attempt.situation, Urgency::Awaited);
        self.agenda
            .await_answer(Next::Plan(request), AwaitedAnswer::Plan(attempt));
    }

    /// Requests a plan without waiting for it.
    pub(super) fn request_plan(&mut self, situation: &Situation, urgency: Urgency) -> RequestId {
        let request = self.plan_request(situation, urgency);
        let id = request.id;
        self.agenda.request(Next::Plan(request));
        id
    }

    fn plan_request(&mut self, situation: &Situation, urgency: Urgency) -> PlanRequest {
        PlanRequest {
            id: self.agenda.next_request(),
            task: Arc::clone(&self.task),
            situation: situation.clone(),
            urgency,
        }
    }

    /// Requests a prepared plan without waiting for it.
    pub(super) fn request_preparation(
        &mut self,
        task: &Arc<Task>,
        course: PlanStart<'_>,
    ) -> RequestId {
        let request = self.prepare_request(task, course, Urgency::Background);
        let id = request.id;
        self.agenda.request(Next::Prepare(request));
        id
    }

    fn prepare_request(
        &mut self,
        task: &Arc<Task>,
        course: PlanStart<'_>,
        urgency: Urgency,
    ) -> PrepareRequest {
        PrepareRequest {
            id: self.agenda.next_request(),
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
        fallback: PreparationFallback,
    ) {
        if self.settings.plans_in_background {
            self.background.set_plan_task(task);
        }
        let request = self.prepare_request(task, course, Urgency::Awaited);
        let preparation = Box::new(AwaitedPreparation {
            course: course.to_owned(),
            begun_steps: course.begun_steps.to_vec(),
            goals: goals.clone(),
            fallback,
        });
        self.agenda.await_answer(
            Next::Prepare(request),
            AwaitedAnswer::Preparation(preparation),
        );
    }

    /// Begins with a prepared plan for which the run has waited.
    fn take_preparation(
        &mut self,
        preparation: AwaitedPreparation,
        prepared: Result<PreparedPlan, PrepareError>,
    ) -> Result<(), Stop> {
        let mut mission = match prepared {
            Ok(mission) => mission,
            Err(error) => {
                return match preparation.fallback {
                    PreparationFallback::EndRun => Err(Stop::Ended(preparation_failure(&error))),
                    PreparationFallback::AdoptUnfitted(search, plan) => {
                        self.switch_unfitted(*search, &plan)
                    }
                    PreparationFallback::SearchAgain(search) => {
                        self.search_again(&search.query().reason)
                    }
                    PreparationFallback::ReplanForGoals(change) => {
                        self.replan_for_changed_goals(&change)
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
        if let PreparationFallback::ReplanForGoals(change) = &preparation.fallback {
            self.ports.recorder.record(&Entry::Kept {
                now: &self.now,
                reason: &change.reason,
            });
        }
        let begun_steps = &preparation.begun_steps;
        let steps = self.action_log.match_steps(&mission, begun_steps);
        mission.begun = steps.unwrap_or_default();
        let course = PlanStart {
            begun_steps,
            ..PlanStart::of(&preparation.course)
        };
        self.begin_prepared_plan_for_goals(course, &preparation.goals, &mission)
    }
}
