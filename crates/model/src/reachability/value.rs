//! Values of expressions that are known never to change.

use elbowroom_num::Rational;

use crate::problem::{Expression, Fluent};

/// The time-independent value of an expression.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Value {
    /// This number, always.
    Number(Rational),
    /// It may change, or depends on an open number.
    Varies,
    /// Some part never has a value.
    Undefined,
}

impl Value {
    /// Returns the value of an expression from the values of its fluents.
    pub(super) fn of(expression: &Expression, fluent: &mut impl FnMut(&Fluent) -> Self) -> Self {
        match expression {
            Expression::Constant(value) => Self::Number(value.clone()),
            Expression::Fluent(leaf) => fluent(leaf),
            Expression::Duration
            | Expression::TotalTime
            | Expression::Violations(_)
            | Expression::Unknown(_) => Self::Varies,
            Expression::Add(parts) => {
                let zero = Self::Number(Rational::ZERO);
                parts.iter().fold(zero, |total, part| {
                    total.combine(Self::of(part, fluent), |a, b| Some(a + b))
                })
            }
            Expression::Multiply(parts) => {
                let one = Self::Number(Rational::ONE);
                parts.iter().fold(one, |product, part| {
                    product.combine(Self::of(part, fluent), |a, b| Some(a * b))
                })
            }
            Expression::Subtract(left, right) => {
                Self::of(left, fluent).combine(Self::of(right, fluent), |a, b| Some(a - b))
            }
            Expression::Divide(left, right) => {
                Self::of(left, fluent).combine(Self::of(right, fluent), Rational::checked_div)
            }
            Expression::Negate(part) => {
                let zero = Self::Number(Rational::ZERO);
                zero.combine(Self::of(part, fluent), |a, b| Some(a - b))
            }
        }
    }

    fn combine(
        self,
        other: Self,
        operation: impl FnOnce(&Rational, &Rational) -> Option<Rational>,
    ) -> Self {
        match (self, other) {
            (Self::Undefined, _) | (_, Self::Undefined) => Self::Undefined,
            (Self::Varies, _) | (_, Self::Varies) => Self::Varies,
            (Self::Number(left), Self::Number(right)) => {
                operation(&left, &right).map_or(Self::Undefined, Self::Number)
            }
        }
    }
}
