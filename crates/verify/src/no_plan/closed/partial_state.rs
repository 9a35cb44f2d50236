//! Evaluation of conditions in a state; the result may be undecided.

use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::{Closure, Node};

/// Returns the value after an update; `None` if a value that it depends on is unknown.
pub(super) fn updated(
    operator: UpdateOperator,
    old: Option<Rational>,
    value: Option<Rational>,
) -> Option<Rational> {
    let value = value?;
    match operator {
        UpdateOperator::Assign => Some(value),
        UpdateOperator::Increase => Some(old? + value),
        UpdateOperator::Decrease => Some(old? - value),
        UpdateOperator::ScaleUp => Some(old? * value),
        UpdateOperator::ScaleDown => old?.checked_div(&value),
    }
}

/// A state as seen by conditions.
pub(super) struct View<'a> {
    pub(super) closure: &'a Closure<'a>,
    pub(super) node: &'a Node,
    pub(super) duration: Option<Rational>,
}

impl View<'_> {
    pub(super) fn is_true(&self, fact: FactId) -> bool {
        if self.closure.facts.contains(&fact) {
            self.node.facts.contains(&fact)
        } else {
            self.closure.instances.task.initial().facts.contains(&fact)
        }
    }

    pub(super) fn value(&self, expression: &Expression) -> Option<Rational> {
        let closure = self.closure;
        let initial = &closure.instances.task.initial().values;
        expression.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent) if closure.fluents.contains(fluent) => {
                self.node.values.get(fluent).cloned()
            }
            Expression::Fluent(fluent) if closure.flowing.contains(fluent) => None,
            Expression::Fluent(fluent) => initial.get(fluent).cloned(),
            Expression::Duration => self.duration.clone(),
            _ => None,
        })
    }

    /// Returns the truth value of the condition, or `Err` if it is undecided.
    pub(super) fn holds(&self, condition: &Condition) -> Result<bool, ()> {
        holds(condition, self)
    }

    pub(super) fn may_hold(&self, condition: &Condition) -> bool {
        self.holds(condition) != Ok(false)
    }
}

impl Moment<()> for View<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, ()> {
        Ok(self.is_true(fact))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, ()> {
        let sides = self.value(left).zip(self.value(right));
        let (left, right) = sides.ok_or(())?;
        Ok(comparison.holds(&left, &right))
    }
}
