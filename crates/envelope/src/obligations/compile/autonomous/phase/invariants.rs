//! Conditions that must hold throughout: over-all conditions that processes and events may violate,
//! and constraints on all states.

use elbowroom_model::ground::Condition;
use elbowroom_plan::InstanceId;

use super::Phase;
use crate::obligations::Refusal;
use crate::obligations::dnf::WantedTruth;

impl Phase<'_> {
    pub(super) fn invariant_label(&self, id: Option<InstanceId>, condition: &Condition) -> String {
        let condition = self.compiler.task.describe_condition(condition);
        match id {
            Some(id) => {
                let name = &self.compiler.plan.plan.instance(id).action.name;
                format!("{name} needs {condition} throughout")
            }
            None => format!("{condition} must hold always"),
        }
    }

    /// Requires the conditions at this moment. With `may_begin`, those of an action that starts
    /// here are not required yet.
    pub(super) fn require_conditions_now(&mut self, may_begin: bool) -> Result<(), Refusal> {
        let plan = &self.compiler.plan.plan;
        let node = self.node;
        let begins =
            |id: Option<InstanceId>| may_begin && id.is_some_and(|id| plan.start(id) == node);
        self.require_conditions(&begins)
    }

    /// Requires the conditions at this moment before anything happens. With `is_next`, the moment
    /// is the next happening, and an action that ends there needs nothing any more. Conditions on
    /// all states are only required after everything has happened.
    pub(super) fn require_conditions_on_arrival(&mut self, is_next: bool) -> Result<(), Refusal> {
        let plan = &self.compiler.plan.plan;
        let next = self.next;
        let ends =
            |id: Option<InstanceId>| id.is_none_or(|id| is_next && Some(plan.end(id)) == next);
        self.require_conditions(&ends)
    }

    fn require_conditions(
        &mut self,
        is_free: &dyn Fn(Option<InstanceId>) -> bool,
    ) -> Result<(), Refusal> {
        let mut demands = Vec::new();
        for (id, conditions) in &self.running {
            for condition in conditions.iter().filter(|_| !is_free(*id)) {
                let reading = self.reading_of(&self.now, *id);
                let broken = reading.alternatives(condition, WantedTruth::NotTrue)?;
                demands.push((self.invariant_label(*id, condition), broken));
            }
        }
        for (course, broken) in demands {
            self.require(&course, broken);
        }
        Ok(())
    }
}
