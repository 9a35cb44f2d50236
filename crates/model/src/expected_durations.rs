//! Expected durations of actions, in place of those that the domain fixes.

use elbowroom_num::Rational;

use crate::ground::{self, Action, Expression};
use crate::problem::{
    self, Body, Comparison, ExpectedDuration, ExpectedDurations, Schema, SchemaId,
};
use crate::task::Task;

impl ExpectedDurations {
    /// Returns the rule for an action of a schema; `None` if its duration is that of the domain.
    pub(crate) fn rule(
        &self,
        id: SchemaId,
        schema: &Schema,
        action: &str,
    ) -> Option<&ExpectedDuration> {
        if self.rules.is_empty() || self.is_included.contains(&id) || !is_fixed(schema) {
            return None;
        }
        let mut rules = self.rules.iter().rev();
        rules.find(|rule| rule.actions.matches(action))
    }
}

impl ExpectedDuration {
    /// Replaces the duration that the domain fixes, unless the action reads it before its end: the world then computes
    /// with the duration of the command. The new bound is undefined where the domain's is.
    pub(crate) fn apply(&self, action: &mut Action) {
        if action.with_planned_duration(&Rational::ZERO).is_some() {
            return;
        }
        let ground::Body::Durative(body) = &mut action.body else {
            return;
        };
        for constraint in &mut body.duration {
            constraint.bound = match std::mem::replace(&mut constraint.bound, Expression::Duration)
            {
                Expression::Constant(duration) => {
                    Expression::Constant(duration * &self.factor + &self.seconds)
                }
                domain => {
                    let factor = Expression::Constant(self.factor.clone());
                    let scaled = Expression::Multiply(vec![domain, factor]);
                    if self.seconds.is_zero() {
                        scaled
                    } else {
                        let seconds = Expression::Constant(self.seconds.clone());
                        Expression::Add(vec![scaled, seconds])
                    }
                }
            };
        }
    }
}

/// Returns `true` if the domain fixes the duration of the actions at their start.
fn is_fixed(schema: &Schema) -> bool {
    let Body::Durative { duration, .. } = &schema.body else {
        return false;
    };
    matches!(
        duration.as_slice(),
        [problem::DurationConstraint {
            comparison: Comparison::Equal,
            at_end: false,
            ..
        }]
    )
}

impl Task {
    /// Returns the task with expected durations, which plans and envelopes use. Facts and fluents keep their numbers.
    #[must_use]
    pub fn with_expected_durations(&self, durations: ExpectedDurations) -> Self {
        let mut task = self.clone();
        let mut problem = (*self.problem).clone();
        problem.expected_durations = durations;
        task.problem = problem.into();
        task
    }

    /// Returns `true` if durations other than those of the domain are expected.
    pub fn has_expected_durations(&self) -> bool {
        !self.problem.expected_durations.rules.is_empty()
    }

    /// Returns the task with the durations of the domain, by which commands and executions are validated. Facts and
    /// fluents keep their numbers.
    #[must_use]
    pub fn with_domain_durations(&self) -> Self {
        if self.has_expected_durations() {
            self.with_expected_durations(ExpectedDurations::default())
        } else {
            self.clone()
        }
    }
}

#[cfg(test)]
mod tests;
