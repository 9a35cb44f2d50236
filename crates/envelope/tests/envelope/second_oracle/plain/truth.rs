//! Ways for conditions to be true or false.

use elbowroom_model::ground::{Condition, Expression};
use elbowroom_model::problem::{Comparison, Unknown};
use elbowroom_num::Rational;

use super::GaveUp;
use super::search::{Context, Search, Step, Trouble};
use crate::second_oracle::polynomial::Polynomial;
use crate::second_oracle::system::Relation;

/// Wanted truth value. A comparison with an undefined number is neither true nor false.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Want {
    True,
    False,
    NotTrue,
    NotFalse,
}

impl Want {
    fn negated(self) -> Self {
        match self {
            Self::True => Self::False,
            Self::False => Self::True,
            Self::NotTrue => Self::NotFalse,
            Self::NotFalse => Self::NotTrue,
        }
    }
}

pub(super) type Wanted<'c> = (&'c Condition, Want);

impl Search<'_> {
    pub(super) fn require(&mut self, condition: &Condition, context: &Context, what: &str) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        self.ways(vec![(condition, Want::NotTrue)], context, &mut |search| {
            search.report(what.to_owned());
            Ok(())
        })
    }

    /// Calls `then` in each way for all conditions to have the wanted truth, provided that some
    /// schedule remains.
    pub(super) fn ways(
        &mut self,
        mut wanted: Vec<Wanted<'_>>,
        context: &Context,
        then: &mut dyn FnMut(&mut Self) -> Step,
    ) -> Step {
        if self.found.is_some() {
            return Ok(());
        }
        let Some((condition, want)) = wanted.pop() else {
            return if self.system.is_feasible() {
                then(self)
            } else {
                Ok(())
            };
        };
        let is_positive = matches!(want, Want::True | Want::NotFalse);
        match condition {
            Condition::Fact(fact) if self.task.is_derived(*fact) => {
                let task = self.task;
                // Conditions of the action and of the rules from here on.
                let mut wanted: Vec<Wanted<'_>> = wanted;
                let rules = task.rules();
                let rules = rules.iter().filter(|rule| rule.head == *fact);
                let bodies: Vec<_> = rules.map(|rule| (&rule.body, want)).collect();
                if is_positive {
                    for body in bodies {
                        let mut wanted = wanted.clone();
                        wanted.push(body);
                        self.ways(wanted, context, then)?;
                    }
                } else {
                    wanted.extend(bodies);
                    self.ways(wanted, context, then)?;
                }
            }
            Condition::Fact(fact) => {
                if context.facts[fact.index()] == is_positive {
                    self.ways(wanted, context, then)?;
                }
            }
            Condition::Not(part) => {
                wanted.push((&**part, want.negated()));
                self.ways(wanted, context, then)?;
            }
            Condition::And(parts) | Condition::Or(parts) => {
                if matches!(condition, Condition::And(_)) == is_positive {
                    wanted.extend(parts.iter().map(|part| (part, want)));
                    self.ways(wanted, context, then)?;
                } else {
                    for part in parts {
                        let mut wanted = wanted.clone();
                        wanted.push((part, want));
                        self.ways(wanted, context, then)?;
                    }
                }
            }
            Condition::Compare(comparison, left, right) => {
                let left = self.value(left, context)?;
                let right = self.value(right, context)?;
                let Some((left, right)) = left.zip(right) else {
                    return match want {
                        Want::True | Want::False => Ok(()),
                        Want::NotTrue | Want::NotFalse => self.ways(wanted, context, then),
                    };
                };
                for (polynomial, relation) in literal(*comparison, &left, &right, is_positive) {
                    self.system.push();
                    self.assert(&polynomial, relation)?;
                    self.ways(wanted.clone(), context, then)?;
                    self.system.pop();
                }
            }
        }
        Ok(())
    }

    /// Returns the value; `None` if it is undefined.
    pub(super) fn value(
        &self,
        expression: &Expression,
        context: &Context,
    ) -> Result<Option<Polynomial>, Trouble> {
        let all = |parts: &[Expression]| -> Result<Option<Vec<Polynomial>>, Trouble> {
            parts.iter().map(|part| self.value(part, context)).collect()
        };
        Ok(match expression {
            Expression::Constant(value) => Some(Polynomial::constant(value)),
            Expression::Fluent(fluent) => context.values[fluent.index()].clone(),
            Expression::Duration => context.duration.clone(),
            Expression::Unknown(Unknown::Parameter(id)) => Some(self.parameter(*id as usize)),
            Expression::Unknown(_) | Expression::TotalTime | Expression::Violations(_) => {
                return Err(Trouble::GaveUp(GaveUp::NotCovered));
            }
            Expression::Add(parts) => all(parts)?.map(|parts| {
                let zero = Polynomial::default();
                parts.iter().fold(zero, |sum, part| sum.plus(part))
            }),
            Expression::Multiply(parts) => all(parts)?.map(|parts| {
                let one = Polynomial::constant(&Rational::ONE);
                parts.iter().fold(one, |product, part| product.times(part))
            }),
            Expression::Subtract(left, right) => {
                let (left, right) = (self.value(left, context)?, self.value(right, context)?);
                left.zip(right).map(|(left, right)| left.minus(&right))
            }
            Expression::Divide(left, right) => {
                let (left, right) = (self.value(left, context)?, self.value(right, context)?);
                let Some((left, right)) = left.zip(right) else {
                    return Ok(None);
                };
                let divisor = right.as_constant();
                let divisor = divisor.ok_or(Trouble::GaveUp(GaveUp::NotCovered))?;
                let factor = divisor.reciprocal();
                factor.map(|factor| left.times(&Polynomial::constant(&factor)))
            }
            Expression::Negate(part) => self
                .value(part, context)?
                .map(|value| Polynomial::default().minus(&value)),
        })
    }
}

/// Returns the ways for `left comparison right` to be true, or false.
fn literal(
    comparison: Comparison,
    left: &Polynomial,
    right: &Polynomial,
    wanted: bool,
) -> Vec<(Polynomial, Relation)> {
    let below = || (left.minus(right), Relation::Below);
    let not_above = || (left.minus(right), Relation::NotAbove);
    let above = || (right.minus(left), Relation::Below);
    let not_below = || (right.minus(left), Relation::NotAbove);
    match (comparison, wanted) {
        (Comparison::Less, true) | (Comparison::AtLeast, false) => vec![below()],
        (Comparison::AtMost, true) | (Comparison::Greater, false) => vec![not_above()],
        (Comparison::Greater, true) | (Comparison::AtMost, false) => vec![above()],
        (Comparison::AtLeast, true) | (Comparison::Less, false) => vec![not_below()],
        (Comparison::Equal, true) => vec![(left.minus(right), Relation::Zero)],
        (Comparison::Equal, false) => vec![below(), above()],
    }
}
