//! Validation of commanded starts.

use elbowroom_num::Rational;

use super::super::evaluate::Fault;
use super::super::violation::{ConditionTime, ViolationKind};
use super::Execution;
use super::present_state::Indeterminate;
use crate::ground::{Action, Body, Condition};
use crate::interference::Footprint;
use crate::task::Task;

impl Execution {
    /// Returns the bound on the duration that a commanded start violates.
    pub(super) fn mistaken_duration(
        &self,
        action: &Action,
        duration: Option<&Rational>,
    ) -> Option<ViolationKind> {
        let Body::Durative(body) = &action.body else {
            return None;
        };
        let Some(duration) = duration else {
            return Some(ViolationKind::NoDuration);
        };
        if duration.is_negative() {
            return Some(ViolationKind::NegativeDuration(duration.clone()));
        }
        let at_start = body.duration.iter().filter(|bound| !bound.at_end);
        for constraint in at_start {
            let Ok(value) = self.moment(Some(duration)).value(&constraint.bound) else {
                continue;
            };
            if !constraint.comparison.holds(duration, &value) {
                return Some(ViolationKind::Duration {
                    duration: duration.clone(),
                    comparison: constraint.comparison,
                    bound: self.task.describe_expression(&constraint.bound),
                    value,
                });
            }
        }
        None
    }

    /// Returns the start condition that does not hold.
    pub(super) fn mistaken_condition(
        &self,
        action: &Action,
        duration: Option<&Rational>,
    ) -> Option<ViolationKind> {
        let (condition, when) = match &action.body {
            Body::Instantaneous(snap) => (&snap.condition, ConditionTime::Now),
            Body::Durative(body) => (&body.start.condition, ConditionTime::Start),
        };
        condition
            .conjuncts()
            .into_iter()
            .find_map(|part| match self.reads(part, duration) {
                Ok(true) | Err(Indeterminate::DoubtfulRead) => None,
                Ok(false) => Some(self.unmet(part, when)),
                Err(Indeterminate::Fault(fault)) => {
                    undefined(&self.task, &fault, self.task.describe_condition(part))
                }
            })
    }

    /// Returns the over-all condition that the commanded duration violates in every state.
    pub(super) fn too_short_or_long(
        &self,
        action: &Action,
        duration: Option<&Rational>,
    ) -> Option<ViolationKind> {
        // An over-all condition is about the time between start and end.
        let duration = duration.filter(|duration| duration.is_positive())?;
        let reads_state = |part: &Condition| {
            let footprint = Footprint::of_condition(&self.task, part);
            !footprint.reads.is_empty() || !footprint.reads_fluents.is_empty()
        };
        let parts = action.durative()?.over_all.conjuncts().into_iter();
        let mut of_duration = parts.filter(|part| !reads_state(part));
        let violated = of_duration.find(|part| self.reads(part, Some(duration)) == Ok(false))?;
        Some(self.unmet(violated, ConditionTime::OverAll))
    }

    fn unmet(&self, part: &Condition, when: ConditionTime) -> ViolationKind {
        ViolationKind::Condition {
            when,
            condition: self.task.describe_condition(part),
            is_after: false,
            is_exact: true,
            reasons: Vec::new(),
            too_late: Vec::new(),
        }
    }
}

/// Returns the mistake of reading a fluent without a value or dividing by zero; `None` for other faults.
fn undefined(task: &Task, fault: &Fault, within: String) -> Option<ViolationKind> {
    match fault {
        Fault::Undefined(fluent) => Some(ViolationKind::Undefined {
            fluent: task.fluent_name(*fluent),
            within,
        }),
        Fault::DivisionByZero(divisor) => Some(ViolationKind::DivisionByZero {
            divisor: task.describe_expression(divisor),
            within,
        }),
        _ => None,
    }
}
