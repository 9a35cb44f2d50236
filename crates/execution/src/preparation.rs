//! Ports through which plans are made ready, and asked what they survive.
//!
//! What executes needs no solver; what stands behind these traits may have one.

use std::collections::BTreeMap;
use std::sync::Arc;

use elbowroom_model::validate::Violation;
use elbowroom_model::{Situation, Task, TimeTriggeredPlan};
use elbowroom_num::Rational;
use elbowroom_plan::deorder::DeorderError;
use elbowroom_plan::parametrize::ParametrizeError;
use elbowroom_plan::{
    DecoupledEnvelope, InstanceId, ParameterId, ParametrizedPlan, PartialOrderPlan, Schedule,
    Valuation,
};

use crate::event::Ticket;
use crate::executor::{Mission, Need, StepId};
use crate::forms::Forms;

/// A plan made ready to be executed.
#[derive(Clone, Debug)]
pub struct Prepared {
    /// The plan with room.
    pub plan: ParametrizedPlan,
    /// For each step of the plan that was made ready, its instance.
    pub instances: Vec<InstanceId>,
    /// The time of each event if nothing deviates.
    pub nominal: Schedule,
    /// For which values it is guaranteed to work, if that was asked for.
    pub envelope: Option<DecoupledEnvelope>,
    /// Forms of the plan's network that executors have asked for before.
    pub forms: Forms,
    /// The partial order of its happenings, if that was asked for ([`Need::PartialOrder`]).
    pub order: Option<PartialOrderPlan>,
}

/// Why a plan cannot be made ready: it does not work, or what is to be known of it cannot be found
/// out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// The judge rejects the plan.
    #[error("the plan is not valid: {0}")]
    Invalid(Box<Violation>),
    /// The plan has no order.
    #[error(transparent)]
    Deorder(#[from] DeorderError),
    /// Something cannot be left open.
    #[error(transparent)]
    Parametrize(#[from] ParametrizeError),
    /// The plan is not guaranteed to work even if nothing deviates.
    #[error("the plan is not guaranteed to work even if nothing deviates")]
    NoGuarantee,
    /// The analyst cannot decide about this plan: the reason.
    #[error("{0}")]
    Beyond(String),
}

/// Makes plans ready.
pub trait Preparer: Send {
    /// Frees a plan from the order that it does not need, and finds out what was asked for.
    ///
    /// # Errors
    /// When the plan does not work.
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: Need,
    ) -> Result<Prepared, PrepareError>;

    /// Begins to make a plan ready, beside whoever asks, in place of what was begun before; whether it
    /// can do that. When it is ready, whoever drives the run tells it so
    /// ([`Event::PlanReady`](crate::Event::PlanReady)), and it is [collected](Preparer::collect).
    fn begin(&mut self, _wanted: &Wanted<'_>) -> bool {
        false
    }

    /// What was begun, which is waited for if it is not ready. The answer is the same as if it had not
    /// been begun beside.
    ///
    /// # Errors
    /// When the plan does not work.
    fn collect(&mut self, wanted: &Wanted<'_>) -> Result<Mission, PrepareError> {
        wanted.mission(self)
    }

    /// What was begun is not needed any more.
    fn give_up(&mut self) {}
}

/// A plan that is to be made ready, and where it begins.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// The task, with the goals of the plan.
    pub task: &'a Task,
    /// The plan, on the world's clock.
    pub plan: &'a TimeTriggeredPlan,
    /// From where.
    pub situation: &'a Situation,
    /// The tickets of what is under way there, in its order.
    pub running: &'a [Ticket],
    /// The present time: it is not begun earlier.
    pub now: &'a Rational,
    /// The form that is asked for.
    pub need: Need,
}

impl Wanted<'_> {
    /// What is wanted, made ready by this preparer at once.
    ///
    /// # Errors
    /// When the plan does not work.
    pub fn mission<P: Preparer + ?Sized>(&self, preparer: &mut P) -> Result<Mission, PrepareError> {
        let task = Arc::new(self.situation.rest_of_task(self.task));
        // What is running comes first in it.
        let plan = self.situation.rest_of_plan(self.plan);
        let ready = preparer.prepare(&task, &plan, self.need)?;
        let steps = ready.instances.iter().copied().map(StepId::from);
        Ok(Mission {
            running: steps.zip(self.running.iter().copied()).collect(),
            begun: BTreeMap::new(),
            task,
            origin: self.situation.time.clone(),
            now: self.now.clone(),
            time_triggered: plan,
            plan: ready.plan,
            instances: ready.instances,
            nominal: ready.nominal,
            envelope: ready.envelope,
            forms: ready.forms,
            order: ready.order,
        })
    }
}

impl<P: Preparer + ?Sized> Preparer for &mut P {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: Need,
    ) -> Result<Prepared, PrepareError> {
        (**self).prepare(task, plan, need)
    }

    fn begin(&mut self, wanted: &Wanted<'_>) -> bool {
        (**self).begin(wanted)
    }

    fn collect(&mut self, wanted: &Wanted<'_>) -> Result<Mission, PrepareError> {
        (**self).collect(wanted)
    }

    fn give_up(&mut self) {
        (**self).give_up();
    }
}

/// Knows which values a plan survives.
pub trait Region: Send {
    /// Why the plan is not guaranteed to work for these values; `None` if it is.
    fn objection(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Option<String>;

    /// A box around these values in which the plan is guaranteed to work: as much of the room nearby as is found soon,
    /// or no more than the values. Of a plan beyond exact analysis, the values are returned if nothing is known to fail
    /// with them.
    ///
    /// # Errors
    /// Why the plan is not guaranteed to work for the values themselves.
    fn surroundings(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Result<DecoupledEnvelope, String> {
        match self.objection(task, plan, values) {
            None => Ok(DecoupledEnvelope::point(values)),
            Some(why) => Err(why),
        }
    }

    /// Whether it is to be asked about plans of which a box says already that they work.
    fn is_asked_inside(&self) -> bool {
        false
    }

    /// Asks again and again how much greater one of the values may be, the others being as they are: whether the
    /// plan is guaranteed to work with that value of the parameter. It works for `values`.
    ///
    /// Whoever has seen that it works with all values up to a greater one may say so without looking again; where it
    /// does not work with something in between, that may be said of what is beyond, too.
    fn growing<'a>(
        &'a mut self,
        task: &'a Arc<Task>,
        plan: &'a ParametrizedPlan,
        values: &Valuation,
        parameter: ParameterId,
    ) -> Box<dyn FnMut(&Rational) -> bool + 'a> {
        let mut tried = values.clone();
        Box::new(move |value| {
            tried[parameter].clone_from(value);
            self.objection(task, plan, &tried).is_none()
        })
    }

    /// One more of it; `None` if it cannot be had.
    fn fork(&self) -> Option<Box<dyn Region>> {
        None
    }
}

impl<P: Preparer + ?Sized> Preparer for Box<P> {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: Need,
    ) -> Result<Prepared, PrepareError> {
        (**self).prepare(task, plan, need)
    }

    fn begin(&mut self, wanted: &Wanted<'_>) -> bool {
        (**self).begin(wanted)
    }

    fn collect(&mut self, wanted: &Wanted<'_>) -> Result<Mission, PrepareError> {
        (**self).collect(wanted)
    }

    fn give_up(&mut self) {
        (**self).give_up();
    }
}
