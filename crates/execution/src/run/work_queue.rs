//! The steps before the next decision of the executor.

use elbowroom_model::Situation;
use elbowroom_model::validate::{self, Verdict, validate};
use elbowroom_num::Rational;

use super::agenda::{Next, PendingStep};
use super::plan_start::{PlanStart, preparation_failure};
use super::{Run, Stop};
use crate::event::Command;
use crate::preparation::PrepareError;
use crate::reason::{Cause, Reason};

impl Run<'_> {
    /// Performs a step, which may add more steps. Returns a command that the world must receive
    /// before anything else is done.
    pub(super) fn perform(&mut self, todo: PendingStep) -> Result<Option<Command>, Stop> {
        match todo {
            PendingStep::Begin(Some(plan)) => {
                // A given plan is not shifted, unlike the remaining steps of a late plan.
                let verdict = validate(&self.task, &plan, &validate::Settings::default());
                if let Verdict::Invalid(violation) = verdict {
                    let error = PrepareError::Invalid(Box::new(violation));
                    return Err(Stop::Ended(preparation_failure(&error)));
                }
                let situation = Situation::initial(&self.task);
                self.adopt_plan(PlanStart::of(&(plan, situation, Vec::new())));
            }
            PendingStep::Begin(None) => self.replan(&Reason::new(Cause::NewPlan))?,
            PendingStep::Decide => self.decide_and_enqueue()?,
            PendingStep::Cancel(tickets) => self.cancel(tickets),
            PendingStep::Send(command) => return Ok(Some(command)),
            PendingStep::Wait(until) => {
                let limit = Some(self.settings.time_limit.clone());
                let changes = [
                    self.goals.next_deadline(&self.now),
                    self.goals.next_release(&self.now),
                ];
                let limits = limit.into_iter().chain(changes.into_iter().flatten());
                let until = limits.fold(until, Rational::min);
                self.agenda.ask(Next::Wait { until });
            }
            PendingStep::CheckTimeouts => self.check_timeouts(),
            PendingStep::TimeOut(ticket, since) => self.time_out(ticket, since),
            PendingStep::WaitForRunning(awaited) => self.continue_settling(awaited),
            PendingStep::WaitForActions(tickets, doubts) => self.wait_for_actions(tickets, doubts),
            PendingStep::Replan(reason) => self.replan(&reason)?,
            PendingStep::Plan(reason) => self.request_awaited_plan(&reason)?,
            PendingStep::Adopt(made) => self.adopt(made),
            PendingStep::AdoptPrepared(mission) => self.begin_prepared_plan(&mission)?,
            PendingStep::RestoreAdoption(task, it) => {
                self.agenda
                    .push(PendingStep::ReportNews(it.plan_events.clone()));
                let course = PlanStart {
                    plan: &it.plan,
                    situation: &it.situation,
                    running: &it.running,
                    begun_steps: &it.begun_steps,
                };
                self.adopt_plan_for_goals(&task, &it.goals, course);
            }
            PendingStep::ReportNews(news) => {
                self.plan_events.splice(0..0, news);
            }
            PendingStep::ShutDown(until) => self.continue_shutdown_until(until),
        }
        Ok(None)
    }
}
