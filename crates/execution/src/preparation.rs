//! Ports: preparation of plans for execution, and analysis of the deviations they tolerate.
//!
//! The executing side needs no solver; the implementations of these traits may use one.

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

use crate::dispatchable_cache::DispatchableCache;
use crate::event::ActionHandle;
use crate::executor::{PlanForm, PreparedPlan, StepId};
use crate::forward::forward_port;

/// A plan prepared for execution.
#[derive(Clone, Debug)]
pub struct PreparationResult {
    /// The given plan, or one of the same steps that start later.
    pub time_triggered: TimeTriggeredPlan,
    /// The deordered plan, with open parameters.
    pub plan: ParametrizedPlan,
    /// For each step of the given plan, its instance.
    pub instances: Vec<InstanceId>,
    /// The time of each event if nothing deviates.
    pub nominal: Schedule,
    /// The values for which it is guaranteed to work, if they were requested.
    pub envelope: Option<DecoupledEnvelope>,
    /// Cache of the dispatchable forms of the plan's networks.
    pub forms: DispatchableCache,
    /// The partial order of its happenings, if it was requested ([`PlanForm::PartialOrder`]).
    pub order: Option<PartialOrderPlan>,
}

/// Reason for which a plan cannot be prepared: the plan does not work, or the required analysis is
/// not possible.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PrepareError {
    /// The validator rejects the plan.
    #[error("the plan is not valid: {0}")]
    Invalid(Box<Violation>),
    /// The plan has no order.
    #[error(transparent)]
    Deorder(#[from] DeorderError),
    /// A quantity cannot be left open.
    #[error(transparent)]
    Parametrize(#[from] ParametrizeError),
    /// The plan is not guaranteed to work even if nothing deviates.
    #[error("the plan is not guaranteed to work even without deviations")]
    NoGuarantee,
    /// The analysis cannot decide about this plan: the reason.
    #[error("{0}")]
    Unsupported(String),
}

/// Prepares plans for execution.
pub trait Preparer: Send {
    /// Removes unnecessary orderings from a plan, and computes the form that is needed.
    ///
    /// # Errors
    /// If the plan does not work.
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm,
    ) -> Result<PreparationResult, PrepareError>;

    /// Begins to prepare a plan in the background, and replaces any preparation begun before.
    /// Returns `false` if the preparer cannot do that. When the plan is prepared, the driver of the
    /// run reports [`Event::PlanReady`](crate::Event::PlanReady), and the run
    /// [collects](Preparer::collect) it.
    fn begin(&mut self, _wanted: &PreparationRequest<'_>) -> bool {
        false
    }

    /// Returns the plan whose preparation was begun; blocks until it is prepared. The result is the
    /// same as without background preparation.
    ///
    /// # Errors
    /// If the plan does not work.
    fn collect(&mut self, wanted: &PreparationRequest<'_>) -> Result<PreparedPlan, PrepareError> {
        wanted.prepare_now(self)
    }

    /// Cancels the preparation that was begun.
    fn give_up(&mut self) {}
}

/// A plan to be prepared, with its initial situation.
#[derive(Clone, Copy, Debug)]
pub struct PreparationRequest<'a> {
    /// The task, with the goals of the plan.
    pub task: &'a Task,
    /// The plan, on the world's clock.
    pub plan: &'a TimeTriggeredPlan,
    /// The initial situation of the plan.
    pub situation: &'a Situation,
    /// The tickets of the actions that are running there, in its order.
    pub running: &'a [ActionHandle],
    /// The present time; the plan does not begin earlier.
    pub now: &'a Rational,
    /// The requested form.
    pub need: PlanForm,
}

impl PreparationRequest<'_> {
    /// Prepares the plan with this preparer, in the foreground.
    ///
    /// # Errors
    /// If the plan does not work.
    pub fn prepare_now<P: Preparer + ?Sized>(
        &self,
        preparer: &mut P,
    ) -> Result<PreparedPlan, PrepareError> {
        let task = Arc::new(self.situation.remaining_task(self.task));
        // The running actions come first in it.
        let plan = self.situation.remaining_plan(self.plan);
        let ready = preparer.prepare(&task, &plan, self.need)?;
        let steps = ready.instances.iter().copied().map(StepId::from);
        Ok(PreparedPlan {
            running: steps.zip(self.running.iter().copied()).collect(),
            begun: BTreeMap::new(),
            task,
            origin: self.situation.time.clone(),
            now: self.now.clone(),
            time_triggered: ready.time_triggered,
            plan: ready.plan,
            instances: ready.instances,
            nominal: ready.nominal,
            envelope: ready.envelope,
            dispatchable_cache: ready.forms,
            order: ready.order,
        })
    }
}

forward_port!(Preparer {
    fn prepare(
        &mut self,
        task: &Arc<Task>,
        plan: &TimeTriggeredPlan,
        need: PlanForm
    ) -> Result<PreparationResult, PrepareError>;
    fn begin(&mut self, wanted: &PreparationRequest<'_>) -> bool;
    fn collect(
        &mut self,
        wanted: &PreparationRequest<'_>
    ) -> Result<PreparedPlan, PrepareError>;
    fn give_up(&mut self);
} ref {});

/// Decides for which parameter values a plan is guaranteed to work.
pub trait RegionOracle: Send {
    /// Returns `true` if the plan is guaranteed to work for these values.
    fn is_feasible(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> bool;

    /// Returns a box around these values for which the plan is guaranteed to work. Depending on the
    /// effort, the box may contain only the values themselves. If the plan is beyond exact
    /// analysis, the values are returned, unless they are known to fail.
    ///
    /// # Errors
    /// The reason for which the plan is not guaranteed to work for the values themselves.
    fn surroundings(
        &mut self,
        task: &Arc<Task>,
        plan: &ParametrizedPlan,
        values: &Valuation,
    ) -> Result<DecoupledEnvelope, String> {
        if self.is_feasible(task, plan, values) {
            Ok(DecoupledEnvelope::point(values))
        } else {
            Err("the plan is not guaranteed to work with the observed values".to_owned())
        }
    }

    /// Returns `true` if the region is to be queried even if a known box shows that the plan works.
    fn is_asked_inside(&self) -> bool {
        false
    }

    /// Returns a predicate for repeated queries that increase one value while the others stay the
    /// same. The predicate holds for a value of the parameter if the plan is guaranteed to work
    /// with it. The plan must work for `values`.
    ///
    /// Implementations may answer from earlier queries: if the plan works with all values up to a
    /// greater one, the predicate holds; if it fails with some smaller value, the predicate may be
    /// `false`.
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
            self.is_feasible(task, plan, &tried)
        })
    }

    /// Returns a copy; `None` if it cannot be copied.
    fn fork(&self) -> Option<Box<dyn RegionOracle>> {
        None
    }
}
