//! Agenda of a run: the tasks before the next decision of its executor.

use std::sync::Arc;

use elbowroom_model::validate::{self, Verdict, validate};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::plan_start::{PlanStart, preparation_failure};
use super::snapshot::PlanAdoption;
use super::{Next, Run, Stop};
use crate::event::{ActionHandle, Command};
use crate::executor::{PlanEvent, PreparedPlan};
use crate::preparation::PrepareError;
use crate::reason::{Cause, Reason};

/// A task. All tasks are instantaneous in the world, except for [`PendingStep::Wait`] and [`PendingStep::Close`].
pub(super) enum PendingStep {
    /// Begin with this plan, or make one.
    Begin(Option<TimeTriggeredPlan>),
    /// Ask the executor for a decision.
    Decide,
    /// Cancel actions.
    Cancel(Vec<ActionHandle>),
    /// Send a recorded command to the world.
    Send(Command),
    /// Wait until then.
    Wait(Rational),
    /// Warn of time-outs, and cancel the actions that have reached theirs.
    CheckTimeouts,
    /// Cancel an action that timed out then, or end the wait for one that was cancelled.
    TimeOut(ActionHandle, Rational),
    /// Wait until these actions have ended; `None` for all actions.
    WaitForRunning(Option<Vec<ActionHandle>>),
    /// Wait until these actions have ended, or until the goals or the number of doubts change.
    WaitForActions(Vec<ActionHandle>, usize),
    /// Decide how to continue without the plan.
    Replan(Reason),
    /// Make a plan from the present situation.
    Plan(Reason),
    /// Begin with a plan when its planning time has passed.
    Adopt(Box<FinishedPlan>),
    /// Begin with a prepared plan.
    AdoptPrepared(Box<PreparedPlan>),
    /// Begin with a plan that another run has begun with, for this task.
    RestoreAdoption(Arc<Task>, Box<PlanAdoption>),
    /// Report events that happened while the plan was made, and that it does not account for.
    ReportNews(Vec<PlanEvent>),
    /// Wait until then for cancelled actions to stop, and end the run.
    ShutDown(Rational),
}

/// A finished plan.
pub(super) struct FinishedPlan {
    pub(super) plan: TimeTriggeredPlan,
    /// The initial situation of the plan.
    pub(super) situation: Situation,
    /// The actions running there.
    pub(super) running: Vec<ActionHandle>,
    /// The end of its planning time, on the world's clock.
    pub(super) ready: Rational,
}

impl Run<'_> {
    /// Performs a task, which may add more tasks. Returns a command that the world must receive
    /// before anything else is done.
    pub(super) fn perform(&mut self, todo: PendingStep) -> Result<Option<Command>, Stop> {
        match todo {
            PendingStep::Begin(Some(plan)) => {
                // A given plan is not shifted, unlike the remaining steps of a late plan.
                let verdict = validate(&self.task, &plan, &validate::Settings::default());
                if let Verdict::Invalid(violation) = verdict {
                    return Err(preparation_failure(&PrepareError::Invalid(Box::new(
                        violation,
                    ))));
                }
                let situation = Situation::initial(&self.task);
                self.adopt_plan(PlanStart::of(&plan, &situation, &[]));
            }
            PendingStep::Begin(None) => self.replan(&Reason::new(Cause::NewPlan))?,
            PendingStep::Decide => self.decide_and_enqueue()?,
            PendingStep::Cancel(tickets) => self.cancel(tickets),
            PendingStep::Send(command) => return Ok(Some(command)),
            PendingStep::Wait(until) => {
                let limit = Some(self.settings.time_limit.clone());
                let changes = [self.next_deadline_of_a_goal(), self.next_release()];
                let limits = limit.into_iter().chain(changes.into_iter().flatten());
                let until = limits.fold(until, Rational::min);
                self.open_request = Some(Next::Wait { until });
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
                self.work_queue
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
