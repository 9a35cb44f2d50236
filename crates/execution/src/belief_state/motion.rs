//! Continuous change of fluents between happenings, as polynomials in time.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_num::Rational;

use super::EvaluationError;
use super::polynomial::Polynomial;

/// An active continuous effect.
pub(super) struct Rate<'a> {
    pub(super) fluent: FluentId,
    pub(super) per_time: &'a Expression,
    pub(super) duration: Option<&'a Rational>,
}

/// Continuously changing values, as functions of the time from now on.
#[derive(Clone, Debug, Default)]
pub(super) struct Motion(BTreeMap<FluentId, Polynomial>);

impl Motion {
    /// Returns the motion that results from these rates.
    ///
    /// A rate may read fluents that move themselves, as long as there is no cycle.
    pub(super) fn of(
        rates: &[Rate<'_>],
        now: &dyn Fn(FluentId) -> Result<Rational, EvaluationError>,
    ) -> Result<Self, EvaluationError> {
        let mut waiting: BTreeMap<FluentId, Vec<&Rate<'_>>> = BTreeMap::new();
        for rate in rates {
            waiting.entry(rate.fluent).or_default().push(rate);
        }
        let mut motion = Self::default();
        while let Some(&first) = waiting.keys().next() {
            let is_ready = |rate: &&Rate<'_>| {
                let mut is_ready = true;
                rate.per_time
                    .visit_fluents(&mut |fluent| is_ready &= !waiting.contains_key(&fluent));
                is_ready
            };
            let ready = waiting
                .iter()
                .find(|(_, rates)| rates.iter().all(is_ready))
                .map(|(&fluent, _)| fluent)
                .ok_or(EvaluationError::Circular(first))?;
            let mut speed = Polynomial::constant(Rational::ZERO);
            for rate in waiting.remove(&ready).into_iter().flatten() {
                let term = Fraction::of(rate.per_time, rate.duration, &|fluent| {
                    motion.value(fluent, now)
                })?;
                speed = speed.plus(&term.as_polynomial()?);
            }
            motion.0.insert(ready, speed.integral(now(ready)?));
        }
        Ok(motion)
    }

    /// Returns `true` if no fluent moves.
    pub(super) fn is_still(&self) -> bool {
        self.0.is_empty()
    }

    /// Returns `true` if the fluent moves.
    pub(super) fn is_changing(&self, fluent: FluentId) -> bool {
        self.0.contains_key(&fluent)
    }

    /// Returns a fluent's value as a function of time. `now` returns the present value of a fluent
    /// that does not move.
    pub(super) fn value(
        &self,
        fluent: FluentId,
        now: &dyn Fn(FluentId) -> Result<Rational, EvaluationError>,
    ) -> Result<Polynomial, EvaluationError> {
        match self.0.get(&fluent) {
            Some(polynomial) => Ok(polynomial.clone()),
            None => Ok(Polynomial::constant(now(fluent)?)),
        }
    }

    /// Returns the values after `elapsed`.
    pub(super) fn after(&self, elapsed: &Rational) -> Vec<(FluentId, Rational)> {
        let moved = self.0.iter();
        moved
            .map(|(fluent, polynomial)| (*fluent, polynomial.at(elapsed)))
            .collect()
    }
}

/// An expression as a function of time: one polynomial divided by another.
pub(super) struct Fraction {
    pub(super) numerator: Polynomial,
    pub(super) denominator: Polynomial,
}

impl Fraction {
    pub(super) fn of(
        expression: &Expression,
        duration: Option<&Rational>,
        read: &dyn Fn(FluentId) -> Result<Polynomial, EvaluationError>,
    ) -> Result<Self, EvaluationError> {
        let of = |part: &Expression| Self::of(part, duration, read);
        Ok(match expression {
            Expression::Constant(value) => Polynomial::constant(value.clone()).into(),
            Expression::Fluent(fluent) => read(*fluent)?.into(),
            Expression::Duration => {
                Polynomial::constant(duration.ok_or(EvaluationError::OpenParameter)?.clone()).into()
            }
            Expression::TotalTime | Expression::Violations(_) | Expression::Unknown(_) => {
                return Err(EvaluationError::OpenParameter);
            }
            Expression::Add(parts) => {
                let mut sum = Self::from(Polynomial::constant(Rational::ZERO));
                for part in parts {
                    sum = sum.plus(&of(part)?);
                }
                sum
            }
            Expression::Multiply(parts) => {
                let mut product = Self::from(Polynomial::constant(Rational::ONE));
                for part in parts {
                    let factor = of(part)?;
                    product.numerator = product.numerator.times(&factor.numerator);
                    product.denominator = product.denominator.times(&factor.denominator);
                }
                product
            }
            Expression::Subtract(left, right) => of(left)?.minus(of(right)?),
            Expression::Negate(part) => {
                let mut part = of(part)?;
                part.numerator = part.numerator.scaled(&-Rational::ONE);
                part
            }
            Expression::Divide(left, right) => {
                let (left, right) = (of(left)?, of(right)?);
                Self {
                    numerator: left.numerator.times(&right.denominator),
                    denominator: left.denominator.times(&right.numerator),
                }
            }
        })
    }

    fn plus(&self, other: &Self) -> Self {
        let left = self.numerator.times(&other.denominator);
        let right = other.numerator.times(&self.denominator);
        Self {
            numerator: left.plus(&right),
            denominator: self.denominator.times(&other.denominator),
        }
    }

    pub(super) fn minus(&self, mut other: Self) -> Self {
        other.numerator = other.numerator.scaled(&-Rational::ONE);
        self.plus(&other)
    }

    /// Returns the fraction as a polynomial, if its denominator is constant.
    fn as_polynomial(&self) -> Result<Polynomial, EvaluationError> {
        let divisor = self
            .denominator
            .as_constant()
            .ok_or(EvaluationError::Quotient)?;
        let factor = divisor
            .reciprocal()
            .ok_or(EvaluationError::DivisionByZero)?;
        Ok(self.numerator.scaled(&factor))
    }
}

impl From<Polynomial> for Fraction {
    fn from(numerator: Polynomial) -> Self {
        Self {
            numerator,
            denominator: Polynomial::constant(Rational::ONE),
        }
    }
}
