//! Evaluation of conditions and expressions in a state.

use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::BeliefState;

/// Reason for which a condition or an expression has no value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EvaluationError {
    /// The fluent has no value.
    Undefined(FluentId),
    /// The fact is in doubt.
    DoubtfulFact(FactId),
    /// The value of the fluent is in doubt.
    DoubtfulValue(FluentId),
    /// Division by zero.
    DivisionByZero,
    /// A rate of change is divided by a moving value.
    Quotient,
    /// The rates of change depend on each other in a cycle.
    Circular(FluentId),
    /// A quantity is left open.
    OpenParameter,
}

/// The state, for conditions that may contain `?duration`.
struct StateView<'a> {
    state: &'a BeliefState,
    duration: Option<&'a Rational>,
    mode: Mode,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    Now,
    /// On arrival, before the present group.
    OnArrival,
    /// Now, without assumptions about doubtful facts and values.
    Certain,
}

impl Moment<EvaluationError> for StateView<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, EvaluationError> {
        if self.state.doubtful_facts.contains_key(&fact) {
            return match self.mode {
                Mode::Certain => Err(EvaluationError::DoubtfulFact(fact)),
                Mode::Now | Mode::OnArrival => Ok(false),
            };
        }
        let before = self.state.facts_on_arrival.get(&fact);
        let before = before.filter(|_| self.mode == Mode::OnArrival).copied();
        Ok(before.unwrap_or_else(|| self.state.fact(fact)))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, EvaluationError> {
        let value = |expression: &Expression| {
            if self.mode == Mode::Certain
                && let Some(fluent) = self.state.doubtful_fluent(expression)
            {
                return Err(EvaluationError::DoubtfulValue(fluent));
            }
            evaluate(expression, self.duration, &|fluent| {
                if self.mode == Mode::OnArrival {
                    self.state.value_on_arrival(fluent)
                } else {
                    self.state.value(fluent)
                }
            })
        };
        Ok(comparison.holds(&value(left)?, &value(right)?))
    }
}

impl BeliefState {
    /// Returns `true` if a condition holds now; `duration` is the value of `?duration`.
    ///
    /// # Errors
    /// If the condition cannot be evaluated.
    pub fn holds(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
    ) -> Result<bool, EvaluationError> {
        self.evaluate_condition(condition, duration, Mode::Now)
    }

    /// Returns `true` if a condition held on arrival at the present moment, before any happening of
    /// it. All happenings of the moment use this state.
    ///
    /// # Errors
    /// If the condition cannot be evaluated.
    pub fn holds_on_arrival(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
    ) -> Result<bool, EvaluationError> {
        self.evaluate_condition(condition, duration, Mode::OnArrival)
    }

    /// Returns the value of an expression without `?duration` now; `None` if it has none.
    pub(crate) fn value_of(&self, expression: &Expression) -> Option<Rational> {
        evaluate(expression, None, &|fluent| self.value(fluent)).ok()
    }

    fn evaluate_condition(
        &self,
        condition: &Condition,
        duration: Option<&Rational>,
        mode: Mode,
    ) -> Result<bool, EvaluationError> {
        let basic = StateView {
            state: self,
            duration,
            mode,
        };
        match self.task.derivation() {
            Some(derivation) if derivation.is_read_by(condition) => {
                let derived = derivation.derive(&basic);
                holds(condition, &derivation.with_derived_facts(&basic, &derived))
            }
            _ => holds(condition, &basic),
        }
    }

    /// Returns `true` if the task's goal holds now.
    ///
    /// # Errors
    /// If the goal cannot be evaluated, for instance because it depends on a doubtful fact.
    pub fn is_goal(&self) -> Result<bool, EvaluationError> {
        self.is_certain(self.task.goal())
    }

    /// Returns `true` if a condition holds now, without assumptions about doubtful facts and
    /// values.
    ///
    /// # Errors
    /// If the condition cannot be evaluated.
    pub fn is_certain(&self, condition: &Condition) -> Result<bool, EvaluationError> {
        self.evaluate_condition(condition, None, Mode::Certain)
    }

    /// Returns the conjuncts of a condition that do not hold, or cannot be evaluated.
    pub fn unmet<'c>(
        &self,
        condition: &'c Condition,
        duration: Option<&Rational>,
    ) -> Vec<&'c Condition> {
        let mut parts = condition.conjuncts();
        parts.retain(|part| self.holds(part, duration) != Ok(true));
        parts
    }

    /// Returns the conjuncts of a condition that did not hold on arrival, or cannot be evaluated.
    pub fn unmet_on_arrival<'c>(
        &self,
        condition: &'c Condition,
        duration: Option<&Rational>,
    ) -> Vec<&'c Condition> {
        let mut parts = condition.conjuncts();
        parts.retain(|part| self.holds_on_arrival(part, duration) != Ok(true));
        parts
    }

    fn doubtful_fluent(&self, expression: &Expression) -> Option<FluentId> {
        let mut found = None;
        if !self.doubtful_values.is_empty() {
            expression.visit_fluents(&mut |fluent| {
                if self.doubtful_values.contains_key(&fluent) {
                    found = Some(fluent);
                }
            });
        }
        found
    }
}

/// Returns the value of an expression.
pub(super) fn evaluate<'v>(
    expression: &Expression,
    duration: Option<&Rational>,
    values: &dyn Fn(FluentId) -> Option<&'v Rational>,
) -> Result<Rational, EvaluationError> {
    let mut fault = None;
    let value = expression.evaluate(&mut |leaf| match leaf {
        Expression::Fluent(fluent) => {
            let value = values(*fluent).cloned();
            if value.is_none() {
                fault = Some(EvaluationError::Undefined(*fluent));
            }
            value
        }
        Expression::Duration if duration.is_some() => duration.cloned(),
        _ => {
            fault = Some(EvaluationError::OpenParameter);
            None
        }
    });
    value.ok_or(fault.unwrap_or(EvaluationError::DivisionByZero))
}
