//! Values of expressions at one moment.

use elbowroom_num::Rational;

use super::polynomial::Polynomial;
use crate::ground::{Expression, FluentId};
use crate::problem::{Comparison, Unknown};

/// Reason why a condition or an expression is undefined.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Fault {
    /// It reads a fluent that has no value.
    Undefined(FluentId),
    /// It divides by zero, with this divisor.
    DivisionByZero(Expression),
    /// It depends on an open number.
    Open(Unknown),
    /// It mentions `?duration` outside of an action, or `total-time`.
    Misplaced(Expression),
    /// It divides by an expression that changes continuously.
    Quotient(Expression),
    /// It reads a fluent whose value is irrational.
    Irrational(FluentId),
    /// It reads a fluent whose rate of change depends, possibly indirectly, on the fluent itself.
    Circular(FluentId),
}

/// Numbers, or functions of time.
pub(super) trait Quantity: Sized + Clone {
    fn constant(value: &Rational) -> Self;
    fn plus(&self, other: &Self) -> Self;
    fn minus(&self, other: &Self) -> Self;
    fn times(&self, other: &Self) -> Self;
    /// Returns the quotient. `divisor` is the expression of `other`, for the fault.
    fn over(&self, other: &Self, divisor: &Expression) -> Result<Self, Fault>;
}

impl Quantity for Rational {
    fn constant(value: &Rational) -> Self {
        value.clone()
    }
    fn plus(&self, other: &Self) -> Self {
        self + other
    }
    fn minus(&self, other: &Self) -> Self {
        self - other
    }
    fn times(&self, other: &Self) -> Self {
        self * other
    }
    fn over(&self, other: &Self, divisor: &Expression) -> Result<Self, Fault> {
        self.checked_div(other)
            .ok_or_else(|| Fault::DivisionByZero(divisor.clone()))
    }
}

impl Quantity for Polynomial {
    fn constant(value: &Rational) -> Self {
        Self::constant(value.clone())
    }
    fn plus(&self, other: &Self) -> Self {
        Self::plus(self, other)
    }
    fn minus(&self, other: &Self) -> Self {
        Self::minus(self, other)
    }
    fn times(&self, other: &Self) -> Self {
        Self::times(self, other)
    }
    fn over(&self, other: &Self, divisor: &Expression) -> Result<Self, Fault> {
        let Some(value) = other.as_constant() else {
            return Err(Fault::Quotient(divisor.clone()));
        };
        let factor = value
            .reciprocal()
            .ok_or_else(|| Fault::DivisionByZero(divisor.clone()))?;
        Ok(self.scaled(&factor))
    }
}

/// Returns the value of an expression, with values of fluents from `fluent`.
pub(super) fn evaluate<Q: Quantity>(
    expression: &Expression,
    duration: Option<&Rational>,
    fluent: &dyn Fn(FluentId) -> Result<Q, Fault>,
) -> Result<Q, Fault> {
    let value = |part: &Expression| evaluate(part, duration, fluent);
    match expression {
        Expression::Constant(value) => Ok(Q::constant(value)),
        Expression::Fluent(id) => fluent(*id),
        Expression::Duration => match duration {
            Some(duration) => Ok(Q::constant(duration)),
            None => Err(Fault::Misplaced(expression.clone())),
        },
        Expression::TotalTime | Expression::Violations(_) => {
            Err(Fault::Misplaced(expression.clone()))
        }
        Expression::Unknown(unknown) => Err(Fault::Open(*unknown)),
        Expression::Add(parts) => {
            let mut total = Q::constant(&Rational::ZERO);
            for part in parts {
                total = total.plus(&value(part)?);
            }
            Ok(total)
        }
        Expression::Multiply(parts) => {
            let mut product = Q::constant(&Rational::ONE);
            for part in parts {
                product = product.times(&value(part)?);
            }
            Ok(product)
        }
        Expression::Subtract(left, right) => Ok(value(left)?.minus(&value(right)?)),
        Expression::Divide(left, right) => value(left)?.over(&value(right)?, right),
        Expression::Negate(part) => Ok(Q::constant(&Rational::ZERO).minus(&value(part)?)),
    }
}

/// Returns `true` if `difference comparison 0`, given the signs of `difference + slack` and
/// `difference - slack`; see [`Settings::slack`](super::Settings::slack).
pub(super) fn compare_signs(comparison: Comparison, raised: i32, lowered: i32) -> bool {
    match comparison {
        Comparison::Less => lowered < 0,
        Comparison::AtMost => lowered <= 0,
        Comparison::AtLeast => raised >= 0,
        Comparison::Greater => raised > 0,
        // Without slack both signs are the same.
        Comparison::Equal => raised >= 0 && lowered <= 0,
    }
}
