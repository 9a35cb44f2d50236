//! Agenda of a run: the steps before the next decision of its executor, and the requests to the
//! driver.

use std::collections::VecDeque;
use std::sync::Arc;

use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use super::background::BackgroundSearch;
use super::goals::{Goals, PendingGoalChange};
use super::settings::Report;
use super::situation::{OverrunEstimate, StartedPlan};
use super::snapshot::PlanAdoption;
use crate::event::{ActionHandle, Command};
use crate::executor::{PlanEvent, PreparedPlan};
use crate::reason::Reason;
use crate::request::{PlanRequest, PrepareRequest, RequestId};

/// The next request of a run to its driver.
#[derive(Clone, Debug, PartialEq)]
pub enum Next {
    /// Send this command to the world; then [`Run::next`](crate::run::Run::next) again.
    Command(Command),
    /// Wait for an observation, at most until `until`; then [`Run::observe`](crate::run::Run::observe).
    Wait {
        /// On the world's clock.
        until: Rational,
    },
    /// Look at these facts and fluents in the world, if possible; then [`Run::observe_requested`](crate::run::Run::observe_requested).
    Look {
        /// Facts.
        facts: Vec<FactId>,
        /// Fluents.
        fluents: Vec<FluentId>,
    },
    /// Make a plan; then [`Run::planned`](crate::run::Run::planned). If the run waits for it
    /// ([`Urgency::Awaited`](crate::Urgency::Awaited)), the request is repeated until then;
    /// otherwise [`Run::next`](crate::run::Run::next) again.
    Plan(PlanRequest),
    /// Prepare a plan for the executor; then [`Run::prepared`](crate::run::Run::prepared), likewise.
    Prepare(PrepareRequest),
    /// Abandon this request, whose answer is not needed any more; then [`Run::next`](crate::run::Run::next) again.
    Abandon(RequestId),
    /// The run is over.
    Over(Report),
}

/// A step. All steps are instantaneous in the world, except for [`PendingStep::Wait`] and [`PendingStep::ShutDown`].
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

/// A finished plan, which is adopted when its planning time has passed.
pub(super) struct FinishedPlan {
    pub(super) course: StartedPlan,
    /// The end of the time that planning takes, on the world's clock.
    pub(super) ready: Rational,
}

/// Request for a plan for which the run waits.
pub(super) struct Attempt {
    pub(super) reason: Reason,
    pub(super) guess: OverrunEstimate,
    pub(super) situation: Situation,
    pub(super) running: Vec<ActionHandle>,
    /// `true` if the present plan continues unless the new one is better.
    pub(super) is_optional: bool,
}

/// Continuation of the run when the awaited answer arrives.
pub(super) enum AwaitedAnswer {
    /// The answer is a plan.
    Plan(Attempt),
    /// The answer is a prepared plan.
    Preparation(Box<AwaitedPreparation>),
}

/// Preparation of a plan for which the run waits.
pub(super) struct AwaitedPreparation {
    pub(super) course: StartedPlan,
    /// The actions of the plan that have begun since.
    pub(super) begun_steps: Vec<ActionHandle>,
    /// The goals of the plan.
    pub(super) goals: Goals,
    /// Continuation if the plan cannot be prepared.
    pub(super) fallback: PreparationFallback,
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

/// The steps before the next decision, and the requests to the driver.
#[derive(Default)]
pub(super) struct Agenda {
    /// The last step is next.
    steps: Vec<PendingStep>,
    /// The open question to the driver.
    question: Option<Next>,
    /// Continuation of the run when the question for a plan is answered.
    continuation: Option<AwaitedAnswer>,
    /// Requests for the driver without an awaited answer.
    outbox: VecDeque<Next>,
    /// Number of requests for plans and prepared plans so far.
    requests: u64,
}

impl Agenda {
    /// Adds a step before the others.
    pub(super) fn push(&mut self, step: PendingStep) {
        self.steps.push(step);
    }

    /// Adds steps before the others, the first one last.
    pub(super) fn extend(&mut self, steps: impl Iterator<Item = PendingStep>) {
        self.steps.extend(steps);
    }

    /// Replaces all steps by this one.
    pub(super) fn restart_with(&mut self, step: PendingStep) {
        self.steps = vec![step];
    }

    pub(super) fn clear(&mut self) {
        self.steps.clear();
    }

    /// Takes the next step; a decision, if there is no other.
    pub(super) fn pop(&mut self) -> PendingStep {
        self.steps.pop().unwrap_or(PendingStep::Decide)
    }

    pub(super) fn is_empty(&self) -> bool {
        self.steps.is_empty()
    }

    /// Returns the news in the order of their insertion if there are no other steps.
    pub(super) fn only_news(&self) -> Option<Vec<PlanEvent>> {
        let news = self.steps.iter().map(|step| match step {
            PendingStep::ReportNews(news) => Some(news.as_slice()),
            _ => None,
        });
        Some(news.collect::<Option<Vec<_>>>()?.concat())
    }

    /// Asks the driver a question. It is repeated until it is answered.
    pub(super) fn ask(&mut self, question: Next) {
        self.question = Some(question);
    }

    /// Asks the driver for a plan or a prepared plan, and continues with the answer.
    pub(super) fn await_answer(&mut self, question: Next, continuation: AwaitedAnswer) {
        self.question = Some(question);
        self.continuation = Some(continuation);
    }

    pub(super) fn question(&self) -> Option<&Next> {
        self.question.as_ref()
    }

    pub(super) fn take_question(&mut self) -> Option<Next> {
        self.question.take()
    }

    /// Returns `true` if the run waits in the world.
    pub(super) fn is_waiting(&self) -> bool {
        matches!(self.question, Some(Next::Wait { .. }))
    }

    /// Takes the continuation of the run if the open question is this request for a plan.
    pub(super) fn answer_plan(&mut self, id: RequestId) -> Option<Attempt> {
        if !matches!(&self.question, Some(Next::Plan(request)) if request.id == id) {
            return None;
        }
        self.question = None;
        match self.continuation.take()? {
            AwaitedAnswer::Plan(attempt) => Some(attempt),
            AwaitedAnswer::Preparation(_) => None,
        }
    }

    /// Takes the continuation of the run if the open question is this request for a prepared plan.
    pub(super) fn answer_preparation(&mut self, id: RequestId) -> Option<Box<AwaitedPreparation>> {
        if !matches!(&self.question, Some(Next::Prepare(request)) if request.id == id) {
            return None;
        }
        self.question = None;
        match self.continuation.take()? {
            AwaitedAnswer::Preparation(preparation) => Some(preparation),
            AwaitedAnswer::Plan(_) => None,
        }
    }

    /// Closes the open question, and forgets the continuation of the run.
    pub(super) fn close_question(&mut self) {
        self.question = None;
        self.continuation = None;
    }

    pub(super) fn next_request(&mut self) -> RequestId {
        self.requests += 1;
        RequestId(self.requests)
    }

    /// Makes a request without waiting for its answer.
    pub(super) fn request(&mut self, request: Next) {
        self.outbox.push_back(request);
    }

    /// Takes the next request without an awaited answer.
    pub(super) fn pop_request(&mut self) -> Option<Next> {
        self.outbox.pop_front()
    }

    pub(super) fn abandon(&mut self, id: RequestId) {
        let before = self.outbox.len();
        self.outbox.retain(|next| next.request() != Some(id));
        if self.outbox.len() == before {
            self.outbox.push_back(Next::Abandon(id));
        }
    }
}

impl Next {
    /// Returns the identifier of a request for a plan or a prepared plan.
    fn request(&self) -> Option<RequestId> {
        match self {
            Self::Plan(request) => Some(request.id),
            Self::Prepare(request) => Some(request.id),
            _ => None,
        }
    }
}
