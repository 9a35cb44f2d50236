//! Numeric fluents along an order. They are not uncertain: where a value is known, it is exact.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use crate::model::{Model, Value};

/// The value of a changing fluent.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Number {
    /// Its value apart from continuous change that goes on.
    settled: Value,
    /// The number of continuous effects that are changing it; while any does, its value depends on
    /// time.
    changing: u32,
}

impl Number {
    /// Returns the present value.
    pub(crate) fn value(&self) -> Value {
        match &self.settled {
            Value::Known(_) if self.changing > 0 => Value::Open,
            settled => settled.clone(),
        }
    }
}

/// All values; those of fluents that nothing in the plan changes are as at the beginning.
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

    /// The value of a leaf.
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
            Expression::Duration => duration.cloned().map_or(Value::Open, Value::Known),
            _ => Value::Open,
        }
    }

    /// The value after an update; `amount` is the right-hand side on arrival. An update that reads a fluent without a
    /// value changes nothing.
    pub(super) fn updated(number: &Number, operator: UpdateOperator, amount: Value) -> Number {
        let is_still = number.changing == 0;
        let settled = match (operator, &number.settled, amount) {
            (_, settled, Value::Undefined) => settled.clone(),
            // An assignment while it changes: what the change has done so far is lost.
            (UpdateOperator::Assign, _, amount) if is_still => amount,
            (UpdateOperator::Assign, _, _) => Value::Open,
            (_, Value::Undefined, _) => Value::Undefined,
            (operator, Value::Known(value), Value::Known(amount)) => match operator {
                UpdateOperator::Increase => Value::Known(value + amount),
                UpdateOperator::Decrease => Value::Known(value - amount),
                UpdateOperator::ScaleUp if is_still => Value::Known(value * amount),
                UpdateOperator::ScaleDown if is_still => match value.checked_div(&amount) {
                    Some(value) => Value::Known(value),
                    None => number.settled.clone(),
                },
                _ => Value::Open,
            },
            _ => Value::Open,
        };
        Number {
            settled,
            changing: number.changing,
        }
    }

    /// The value after an update that may or may not take place.
    pub(super) fn maybe_updated(number: &Number) -> Number {
        Number {
            settled: Value::Open,
            changing: number.changing,
        }
    }

    /// A continuous effect begins.
    pub(super) fn begun(number: &Number) -> Number {
        Number {
            settled: number.settled.clone(),
            changing: number.changing + 1,
        }
    }

    /// A continuous effect stops, having changed the fluent by `amount`.
    pub(super) fn stopped(number: &Number, amount: Value) -> Number {
        Number {
            settled: match (&number.settled, amount) {
                (Value::Undefined, _) => Value::Undefined,
                (Value::Known(value), Value::Known(amount)) => Value::Known(value + amount),
                _ => Value::Open,
            },
            changing: number.changing.saturating_sub(1),
        }
    }
}
