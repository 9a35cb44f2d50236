//! Explanations of false conditions: the responsible parts, and their last changes.

use std::collections::BTreeSet;

use elbowroom_num::Rational;

use super::evaluate::Fault;
use super::state::Reading;
use super::violation::{Occurrence, Reason};
use crate::derivation::{Moment, holds};
use crate::ground::{Condition, Expression, FactId};
use crate::task::Task;

/// Data for an explanation.
pub(super) struct ExplanationContext<'a> {
    pub(super) task: &'a Task,
    /// Numbers at the moment in question.
    pub(super) reading: &'a Reading<'a>,
    /// Facts, derived ones included, at that moment.
    pub(super) moment: &'a dyn Moment<Fault>,
    /// The last change of a fact.
    pub(super) last_change: &'a dyn Fn(FactId) -> Option<Occurrence>,
}

impl ExplanationContext<'_> {
    /// Returns the parts of a false condition that prevent it from being true.
    pub(super) fn reasons(&self, condition: &Condition) -> Vec<Reason> {
        let mut reasons = Vec::new();
        self.collect(condition, false, &mut reasons);
        reasons
    }

    /// Adds the parts that give `condition` the truth value `is_true`.
    fn collect(&self, condition: &Condition, is_true: bool, reasons: &mut Vec<Reason>) {
        if holds(condition, self.moment) != Ok(is_true) {
            return;
        }
        match condition {
            Condition::Fact(fact) => reasons.push(Reason::Fact {
                fact: self.task.fact_name(*fact),
                is_true,
                since: (self.last_change)(*fact),
            }),
            Condition::Compare(operator, left, right) => {
                let value = |side| self.reading.value(side).unwrap_or_default();
                reasons.push(Reason::Comparison {
                    comparison: self.task.describe_condition(condition),
                    operator: *operator,
                    values: self.values([left, right]),
                    left: value(left),
                    right: value(right),
                    is_true,
                });
            }
            Condition::Not(part) => self.collect(part, !is_true, reasons),
            Condition::And(parts) | Condition::Or(parts) => {
                for part in parts {
                    self.collect(part, is_true, reasons);
                }
            }
        }
    }

    fn values(&self, expressions: [&Expression; 2]) -> Vec<(String, Rational)> {
        let mut values = Vec::new();
        let mut seen = BTreeSet::new();
        for expression in expressions {
            expression.visit_leaves(&mut |leaf| {
                if matches!(leaf, Expression::Fluent(_) | Expression::Duration) {
                    let name = self.task.describe_expression(leaf);
                    if let Ok(value) = self.reading.value(leaf)
                        && seen.insert(name.clone())
                    {
                        values.push((name, value));
                    }
                }
            });
        }
        values
    }
}
