//! How fluents move between happenings: polynomials in time.

use std::collections::BTreeMap;

use elbowroom_model::ground::{Expression, FluentId};
use elbowroom_num::Rational;

use super::Unreadable;

/// A polynomial in the time since the last happening; coefficients by power.
#[derive(Clone, Debug, PartialEq)]
struct Polynomial(Vec<Rational>);

/// A continuous effect at work.
pub(super) struct Rate<'a> {
    pub(super) fluent: FluentId,
    pub(super) per_time: &'a Expression,
    pub(super) duration: Option<&'a Rational>,
}

/// The values that moving fluents have after `elapsed`.
///
/// A rate may read fluents that move themselves, as long as none depends on itself in the end.
pub(super) fn moved(
    rates: &[Rate<'_>],
    elapsed: &Rational,
    now: &dyn Fn(FluentId) -> Result<Rational, Unreadable>,
) -> Result<Vec<(FluentId, Rational)>, Unreadable> {
    let mut waiting: BTreeMap<FluentId, Vec<&Rate<'_>>> = BTreeMap::new();
    for rate in rates {
        waiting.entry(rate.fluent).or_default().push(rate);
    }
    let mut motion: BTreeMap<FluentId, Polynomial> = BTreeMap::new();
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
            .ok_or(Unreadable::Circular(first))?;
        let mut speed = Polynomial(Vec::new());
        for rate in waiting.remove(&ready).into_iter().flatten() {
            let term = Polynomial::of(rate.per_time, rate.duration, &|fluent| match motion
                .get(&fluent)
            {
                Some(polynomial) => Ok(polynomial.clone()),
                None => Ok(Polynomial(vec![now(fluent)?])),
            })?;
            speed = speed.plus(&term);
        }
        motion.insert(ready, speed.integral(now(ready)?));
    }
    Ok(motion
        .into_iter()
        .map(|(fluent, polynomial)| (fluent, polynomial.at(elapsed)))
        .collect())
}

impl Polynomial {
    fn of(
        expression: &Expression,
        duration: Option<&Rational>,
        read: &dyn Fn(FluentId) -> Result<Self, Unreadable>,
    ) -> Result<Self, Unreadable> {
        let of = |part: &Expression| Self::of(part, duration, read);
        Ok(match expression {
            Expression::Constant(value) => Self(vec![value.clone()]),
            Expression::Fluent(fluent) => read(*fluent)?,
            Expression::Duration => Self(vec![duration.ok_or(Unreadable::Open)?.clone()]),
            Expression::TotalTime | Expression::Unknown(_) => return Err(Unreadable::Open),
            Expression::Add(parts) => {
                let mut sum = Self(Vec::new());
                for part in parts {
                    sum = sum.plus(&of(part)?);
                }
                sum
            }
            Expression::Multiply(parts) => {
                let mut product = Self(vec![Rational::ONE]);
                for part in parts {
                    product = product.times(&of(part)?);
                }
                product
            }
            Expression::Subtract(left, right) => {
                of(left)?.plus(&of(right)?.scaled(&-Rational::ONE))
            }
            Expression::Negate(part) => of(part)?.scaled(&-Rational::ONE),
            Expression::Divide(left, right) => {
                let divisor = of(right)?;
                let [divisor] = divisor.0.as_slice() else {
                    return Err(Unreadable::Quotient);
                };
                of(left)?.scaled(&divisor.reciprocal().ok_or(Unreadable::DivisionByZero)?)
            }
        })
    }

    fn plus(&self, other: &Self) -> Self {
        let count = self.0.len().max(other.0.len());
        let at = |p: &Self, i: usize| p.0.get(i).cloned().unwrap_or_default();
        Self((0..count).map(|i| at(self, i) + at(other, i)).collect())
    }

    fn times(&self, other: &Self) -> Self {
        let count = (self.0.len() + other.0.len()).saturating_sub(1);
        let mut product = vec![Rational::ZERO; count];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        Self(product)
    }

    fn scaled(&self, factor: &Rational) -> Self {
        Self(self.0.iter().map(|c| c * factor).collect())
    }

    fn integral(&self, initial: Rational) -> Self {
        let mut power = Rational::ZERO;
        let raised = self.0.iter().map(|c| {
            power += &Rational::ONE;
            c / &power
        });
        let mut coefficients = vec![initial];
        coefficients.extend(raised);
        Self(coefficients)
    }

    fn at(&self, time: &Rational) -> Rational {
        let horner = |value: Rational, c: &Rational| value * time + c;
        self.0.iter().rev().fold(Rational::ZERO, horner)
    }
}
