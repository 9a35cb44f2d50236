//! Numeric fluents along an order. They are not uncertain: a known value is exact.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use crate::model::{Model, Value};

/// Value of a changing fluent.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Number {
    /// Value without running continuous changes.
    settled: Value,
    /// Number of continuous effects that are changing it. While there are any, its value depends on
    /// time.
    changing: u32,
}

impl Number {
    /// Returns the present value.
    pub(crate) fn value(&self) -> Value {
        match &self.settled {
            Value::Known(_) if self.changing > 0 => Value::TimeDependent,
            settled => settled.clone(),
        }
    }
}

/// All values. Fluents that nothing in the plan changes have their initial values.
#[derive(Clone, Debug)]
pub(super) struct Numbers {
    constant: BTreeMap<FluentId, Rational>,
    pub(super) changing: Vec<Number>,
}

impl Numbers {
    pub(super) fn new(model: &Model, values: &BTreeMap<FluentId, Rational>) -> Self {
        let number = |fluent: &FluentId| Number {
            settled: Value::from(values.get(fluent)),
            changing: 0,
        };
        Self {
            constant: values.clone(),
            changing: model.fluents.iter().map(number).collect(),
        }
    }

    /// Returns the value of a leaf.
    pub(super) fn value(
        &self,
        model: &Model,
        leaf: &Expression,
        duration: Option<&Rational>,
    ) -> Value {
        match leaf {
            Expression::Fluent(fluent) => match model.fluent_position(*fluent) {
                Some(position) => self.changing[position].value(),
                None => Value::from(self.constant.get(fluent)),
            },
            Expression::Duration => duration.cloned().map_or(Value::TimeDependent, Value::Known),
            _ => Value::TimeDependent,
        }
    }

    /// Returns the value after an update; `amount` is the right-hand side on arrival. An update
    /// that reads a fluent without a value changes nothing.
    pub(super) fn updated(number: &Number, operator: UpdateOperator, amount: Value) -> Number {
        let is_still = number.changing == 0;
        let settled = match (operator, &number.settled, amount) {
            (_, settled, Value::Undefined) => settled.clone(),
            // The value is assigned during a continuous change, and the amount of that change is
            // unknown.
            (UpdateOperator::Assign, _, amount) if is_still => amount,
            (UpdateOperator::Assign, _, _) => Value::TimeDependent,
            (_, Value::Undefined, _) => Value::Undefined,
            (operator, Value::Known(value), Value::Known(amount)) => match operator {
                UpdateOperator::Increase => Value::Known(value + amount),
                UpdateOperator::Decrease => Value::Known(value - amount),
                UpdateOperator::ScaleUp if is_still => Value::Known(value * amount),
                UpdateOperator::ScaleDown if is_still => match value.checked_div(&amount) {
                    Some(value) => Value::Known(value),
                    None => number.settled.clone(),
                },
                _ => Value::TimeDependent,
            },
            _ => Value::TimeDependent,
        };
        Number {
            settled,
            changing: number.changing,
        }
    }

    /// Returns the value after an update that may or may not take place.
    pub(super) fn maybe_updated(number: &Number) -> Number {
        Number {
            settled: Value::TimeDependent,
            changing: number.changing,
        }
    }

    /// Returns the value after the start of a continuous effect.
    pub(super) fn after_effect_start(number: &Number) -> Number {
        Number {
            settled: number.settled.clone(),
            changing: number.changing + 1,
        }
    }

    /// Returns the value after the end of a continuous effect that has changed the fluent by
    /// `amount`.
    pub(super) fn after_effect_end(number: &Number, amount: Value) -> Number {
        Number {
            settled: match (&number.settled, amount) {
                (Value::Undefined, _) => Value::Undefined,
                (Value::Known(value), Value::Known(amount)) => Value::Known(value + amount),
                _ => Value::TimeDependent,
            },
            changing: number.changing.saturating_sub(1),
        }
    }
}
