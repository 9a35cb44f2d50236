//! Box that grows as long as every schedule in it is valid.

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};

use super::Soundness;
use crate::obligations::Refusal;

/// Box in which every schedule is valid. It is not required that each value has a schedule. So if a
/// parameter is the bound of a constraint, the ends of its interval can also be used as the bounds
/// of that constraint.
#[derive(Clone, Debug)]
pub struct SoundBox<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    soundness: Soundness,
    envelope: DecoupledEnvelope,
}

impl<'a> SoundBox<'a> {
    /// Creates a box with the nominal values; `None` if some schedule is invalid at these values.
    ///
    /// # Errors
    /// If the plan has no schedule at its nominal values, or contains something beyond exact linear
    /// reasoning.
    pub fn new(task: &'a Task, plan: &'a ParametrizedPlan) -> Result<Option<Self>, Refusal> {
        let nominal = plan.nominal();
        let soundness = Soundness::for_values(task, plan, &nominal)?;
        let mut soundness = soundness.ok_or(Refusal::NoNominalSchedule)?;
        let envelope = DecoupledEnvelope::point(&nominal);
        let broken = soundness.broken(task, plan, &envelope, None)?;
        Ok(broken.is_none().then_some(Self {
            task,
            plan,
            soundness,
            envelope,
        }))
    }

    /// Returns the box.
    pub fn envelope(&self) -> &DecoupledEnvelope {
        &self.envelope
    }

    /// Moves one end out to `reach` ([`BoxEnd::reach`]; `None` is infinitely far), if every
    /// schedule stays valid. Returns `true` if it does.
    ///
    /// # Errors
    /// If there are too many cases to decide.
    pub fn try_reach(&mut self, end: BoxEnd, reach: Option<Rational>) -> Result<bool, Refusal> {
        let candidate = end.with_reach(&self.envelope, reach);
        let broken = self
            .soundness
            .broken(self.task, self.plan, &candidate, Some(end))?;
        if broken.is_none() {
            self.envelope = candidate;
        }
        Ok(broken.is_none())
    }
}
