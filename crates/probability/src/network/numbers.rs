//! Numeric fluents along an order. They are not uncertain: where a value is known, it is exact.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use crate::model::Model;

/// The value of a changing fluent.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Number {
    /// Its value apart from continuous change that goes on; `None` if that is not known.
    settled: Option<Rational>,
    /// The number of continuous effects that are changing it; while any does, its value depends on
    /// time.
    changing: u32,
}

impl Number {
    pub(crate) fn known(&self) -> Option<&Rational> {
        self.settled.as_ref().filter(|_| self.changing == 0)
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
            settled: values.get(fluent).cloned(),
            changing: 0,
        };
        Self {
            constant: values.clone(),
            changing: model.fluents.iter().map(number).collect(),
        }
    }

    /// The value of a leaf, where it is known.
    pub(super) fn value(
        &self,
        model: &Model,
        leaf: &Expression,
        duration: Option<&Rational>,
    ) -> Option<Rational> {
        match leaf {
            Expression::Fluent(fluent) => match model.fluent_position(*fluent) {
                Some(position) => self.changing[position].known().cloned(),
                None => self.constant.get(fluent).cloned(),
            },
            Expression::Duration => duration.cloned(),
            _ => None,
        }
    }

    /// The value after an update; `amount` is the right-hand side on arrival.
    pub(super) fn updated(
        number: &Number,
        operator: UpdateOperator,
        amount: Option<Rational>,
    ) -> Number {
        let settled = match (operator, number.settled.clone(), amount) {
            // An assignment while it changes: what the change has done so far is lost.
            (UpdateOperator::Assign, _, amount) if number.changing == 0 => amount,
            (UpdateOperator::Increase, Some(value), Some(amount)) => Some(value + amount),
            (UpdateOperator::Decrease, Some(value), Some(amount)) => Some(value - amount),
            (UpdateOperator::ScaleUp, Some(value), Some(amount)) if number.changing == 0 => {
                Some(value * amount)
            }
            (UpdateOperator::ScaleDown, Some(value), Some(amount)) if number.changing == 0 => {
                value.checked_div(&amount)
            }
            _ => None,
        };
        Number {
            settled,
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
    pub(super) fn stopped(number: &Number, amount: Option<Rational>) -> Number {
        Number {
            settled: match (number.settled.clone(), amount) {
                (Some(value), Some(amount)) => Some(value + amount),
                _ => None,
            },
            changing: number.changing.saturating_sub(1),
        }
    }
}
