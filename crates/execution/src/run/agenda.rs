//! Agenda of a run: the tasks before the next decision of its executor.

use std::sync::Arc;

use elbowroom_model::validate::{self, Verdict, validate};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::beginning::{Course, no_plan};
use super::stand::TakesUp;
use super::{Next, Run, Stop};
use crate::event::{Command, Ticket};
use crate::executor::{Mission, News};
use crate::preparation::PrepareError;
use crate::reason::{Cause, Reason};

/// A task. All tasks are instantaneous in the world, except for [`Todo::Pass`] and [`Todo::Close`].
pub(super) enum Todo {
    /// Begin with this plan, or make one.
    Begin(Option<TimeTriggeredPlan>),
    /// Ask the executor for a decision.
    Decide,
    /// Cancel actions.
    Cancel(Vec<Ticket>),
    /// Send a recorded command to the world.
    Send(Command),
    /// Wait until then.
    Pass(Rational),
    /// Warn of time-outs, and cancel the actions that have reached theirs.
    CheckTimeouts,
    /// Cancel an action that timed out then, or end the wait for one that was cancelled.
    TimeOut(Ticket, Rational),
    /// Wait until these actions have ended; `None` for all actions.
    Settle(Option<Vec<Ticket>>),
    /// Wait until these actions have ended, or until the goals or the number of doubts change.
    Linger(Vec<Ticket>, usize),
    /// Decide how to continue without the plan.
    Replan(Reason),
    /// Make a plan from the present situation.
    Plan(Reason),
    /// Begin with a plan when its planning time has passed.
    Adopt(Box<Made>),
    /// Begin with a prepared plan.
    TakeUp(Box<Mission>),
    /// Begin with a plan that another run has begun with, for this task.
    TakeUpAgain(Arc<Task>, Box<TakesUp>),
    /// Report events that happened while the plan was made, and that it does not account for.
    Tell(Vec<News>),
    /// Wait until then for cancelled actions to stop, and end the run.
    Close(Rational),
}

/// A finished plan.
pub(super) struct Made {
    pub(super) plan: TimeTriggeredPlan,
    /// The initial situation of the plan.
    pub(super) situation: Situation,
    /// The actions running there.
    pub(super) running: Vec<Ticket>,
    /// The end of its planning time, on the world's clock.
    pub(super) ready: Rational,
}

impl Run<'_> {
    /// Performs a task, which may add more tasks. Returns a command that the world must receive
    /// before anything else is done.
    pub(super) fn perform(&mut self, todo: Todo) -> Result<Option<Command>, Stop> {
        match todo {
            Todo::Begin(Some(plan)) => {
                // A given plan is not shifted, unlike the remaining steps of a late plan.
                let verdict = validate(&self.task, &plan, &validate::Settings::default());
                if let Verdict::Invalid(violation) = verdict {
                    return Err(no_plan(&PrepareError::Invalid(Box::new(violation))));
                }
                let situation = Situation::initial(&self.task);
                self.take_up(Course::of(&plan, &situation, &[]));
            }
            Todo::Begin(None) => self.replan(&Reason::new(Cause::NewPlan))?,
            Todo::Decide => self.decide_and_follow()?,
            Todo::Cancel(tickets) => self.cancel(tickets),
            Todo::Send(command) => return Ok(Some(command)),
            Todo::Pass(until) => {
                let limit = Some(self.settings.time_limit.clone());
                let limits = limit.into_iter().chain(self.next_deadline_of_a_goal());
                let until = limits.fold(until, Rational::min);
                self.asked = Some(Next::Wait { until });
            }
            Todo::CheckTimeouts => self.check_timeouts(),
            Todo::TimeOut(ticket, since) => self.time_out(ticket, since),
            Todo::Settle(awaited) => self.go_on_settling(awaited),
            Todo::Linger(tickets, doubts) => self.linger(tickets, doubts),
            Todo::Replan(reason) => self.replan(&reason)?,
            Todo::Plan(reason) => self.plan_from_here(&reason)?,
            Todo::Adopt(made) => self.adopt(made),
            Todo::TakeUp(mission) => self.begin_mission(&mission)?,
            Todo::TakeUpAgain(task, it) => {
                self.agenda.push(Todo::Tell(it.news.clone()));
                let course = Course {
                    plan: &it.plan,
                    situation: &it.situation,
                    running: &it.running,
                    begun: &it.begun,
                };
                self.take_up_for(&task, &it.goals, course);
            }
            Todo::Tell(news) => {
                self.news.splice(0..0, news);
            }
            Todo::Close(until) => self.close(until),
        }
        Ok(None)
    }
}
