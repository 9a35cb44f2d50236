//! Requests of a run for plans and for prepared plans, and the workers that answer them.

use std::sync::Arc;

use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;

use crate::event::{ActionHandle, Event};
use crate::executor::{PlanForm, PreparedPlan};
use crate::forward::forward_port;
use crate::planning::{Planned, Planner};
use crate::preparation::{PreparationRequest, PrepareError, Preparer};
use crate::world::{TimeAdvance, World, WorldError};

/// Identifies a request within its run. Later requests have greater identifiers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RequestId(pub u64);

/// When a run needs the answer to a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Urgency {
    /// The run waits for the answer.
    Awaited,
    /// The run continues without the answer, and processes it when it arrives.
    Background,
    /// The run expects to make the same request later, and ignores answers to this one. A worker
    /// that plans in the background can begin now.
    Anticipated,
}

/// Request for a plan. Two requests are equal if their identifiers are.
#[derive(Clone, Debug)]
pub struct PlanRequest {
    /// The identifier.
    pub id: RequestId,
    /// The task, with the goals of the plan.
    pub task: Arc<Task>,
    /// The initial situation of the plan.
    pub situation: Situation,
    /// When the answer is needed.
    pub urgency: Urgency,
}

impl PartialEq for PlanRequest {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

/// Request for a prepared plan. Two requests are equal if their identifiers are.
#[derive(Clone, Debug)]
pub struct PrepareRequest {
    /// The identifier.
    pub id: RequestId,
    /// The task, with the goals of the plan.
    pub task: Arc<Task>,
    /// The plan, on the world's clock.
    pub plan: TimeTriggeredPlan,
    /// The initial situation of the plan.
    pub situation: Situation,
    /// The tickets of the actions that are running there, in its order.
    pub running: Vec<ActionHandle>,
    /// The present time. The plan begins no earlier.
    pub now: Rational,
    /// The form that the executor needs.
    pub need: PlanForm,
    /// When the answer is needed: [`Urgency::Awaited`] or [`Urgency::Background`].
    pub urgency: Urgency,
}

impl PrepareRequest {
    /// Borrows the parameters of the preparation.
    pub fn preparation_request(&self) -> PreparationRequest<'_> {
        PreparationRequest {
            task: &self.task,
            plan: &self.plan,
            situation: &self.situation,
            running: &self.running,
            now: &self.now,
            need: self.need,
        }
    }
}

impl PartialEq for PrepareRequest {
    fn eq(&self, other: &Self) -> bool {
        self.id == other.id
    }
}

/// Answer to a background request.
#[derive(Clone, Debug)]
pub enum Answer {
    /// To a [`PlanRequest`].
    Planned(RequestId, Planned),
    /// To a [`PrepareRequest`].
    Prepared(RequestId, Result<PreparedPlan, PrepareError>),
}

/// Answers the requests of a run: at once, or later, while the run continues.
pub trait Workers: Send {
    /// Returns the answer, or `None` if it is among the later [answers](Workers::answers). An awaited request is
    /// answered at once; a foreseen one is not answered.
    fn plan(&mut self, request: &PlanRequest) -> Option<Planned>;

    /// Returns the answer, or `None` if it is among the later [answers](Workers::answers). An awaited request is
    /// answered at once.
    fn prepare(&mut self, request: &PrepareRequest) -> Option<Result<PreparedPlan, PrepareError>>;

    /// Abandons a background request. Its answer is not needed any more.
    fn abandon(&mut self, _id: RequestId) {}

    /// Waits in the world. Workers with open requests return early when there is an answer.
    ///
    /// # Errors
    /// When the world fails.
    fn wait(&mut self, world: &mut dyn World, until: &Rational) -> Result<TimeAdvance, WorldError> {
        world.wait(until)
    }

    /// Returns the answers to background requests since the last call.
    fn answers(&mut self) -> Vec<Answer> {
        Vec::new()
    }
}

forward_port!(Workers {
    fn plan(&mut self, request: &PlanRequest) -> Option<Planned>;
    fn prepare(&mut self, request: &PrepareRequest) -> Option<Result<PreparedPlan, PrepareError>>;
    fn abandon(&mut self, id: RequestId);
    fn wait(&mut self, world: &mut dyn World, until: &Rational) -> Result<TimeAdvance, WorldError>;
    fn answers(&mut self) -> Vec<Answer>;
} ref {});

/// Workers made of a planner and a preparer.
///
/// Ports that work in the background ([`Planner::begin`], [`Preparer::begin`]) announce their
/// answers by [`Event::PlanMade`] and [`Event::PlanReady`] in the world's observations.
pub struct PortWorkers<'a> {
    planner: Box<dyn Planner + 'a>,
    preparer: Box<dyn Preparer + 'a>,
    planning: Option<PlanRequest>,
    preparing: Option<PrepareRequest>,
    answers: Vec<Answer>,
}

impl<'a> PortWorkers<'a> {
    /// Creates workers from both ports.
    pub fn new(planner: impl Planner + 'a, preparer: impl Preparer + 'a) -> Self {
        Self {
            planner: Box::new(planner),
            preparer: Box::new(preparer),
            planning: None,
            preparing: None,
            answers: Vec::new(),
        }
    }

    /// Collects the answer that a port has announced.
    fn collect(&mut self, event: &Event) {
        match event {
            Event::PlanMade => self.answers.extend(self.planning.take().map(|it| {
                let made = self.planner.collect(&it.task, &it.situation);
                Answer::Planned(it.id, made)
            })),
            Event::PlanReady => self.answers.extend(self.preparing.take().map(|it| {
                let ready = self.preparer.collect(&it.preparation_request());
                Answer::Prepared(it.id, ready)
            })),
            _ => {}
        }
    }
}

impl Workers for PortWorkers<'_> {
    fn plan(&mut self, request: &PlanRequest) -> Option<Planned> {
        let PlanRequest {
            task, situation, ..
        } = request;
        match request.urgency {
            Urgency::Awaited => Some(self.planner.plan(task, situation)),
            Urgency::Background if self.planner.begin(task, situation) => {
                self.planning = Some(request.clone());
                None
            }
            Urgency::Background => Some(self.planner.collect(task, situation)),
            Urgency::Anticipated => {
                self.planner.expect(task, situation);
                None
            }
        }
    }

    fn prepare(&mut self, request: &PrepareRequest) -> Option<Result<PreparedPlan, PrepareError>> {
        let wanted = request.preparation_request();
        match request.urgency {
            Urgency::Background if self.preparer.begin(&wanted) => {
                self.preparing = Some(request.clone());
                None
            }
            Urgency::Background => Some(self.preparer.collect(&wanted)),
            Urgency::Awaited | Urgency::Anticipated => {
                Some(wanted.prepare_now(&mut *self.preparer))
            }
        }
    }

    fn abandon(&mut self, id: RequestId) {
        if self.preparing.take_if(|it| it.id == id).is_some() {
            self.preparer.give_up();
        }
        if self.planning.take_if(|it| it.id == id).is_some() {
            self.planner.give_up();
        }
    }

    fn wait(&mut self, world: &mut dyn World, until: &Rational) -> Result<TimeAdvance, WorldError> {
        let mut passage = world.wait(until)?;
        passage.observations.retain(|it| {
            self.collect(&it.event);
            !matches!(it.event, Event::PlanMade | Event::PlanReady)
        });
        Ok(passage)
    }

    fn answers(&mut self) -> Vec<Answer> {
        std::mem::take(&mut self.answers)
    }
}
