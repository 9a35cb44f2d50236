//! Violations of a condition at a moment, right after it, and throughout a part with constant rates
//! of change.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{Condition, Expression, FluentId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;
use elbowroom_plan::{Schedule, Valuation};

use crate::linear::Linear;
use crate::obligations::dnf::{Alternatives, always_if};
use crate::obligations::timeline::Reading;
use crate::obligations::{Inequality, Refusal};

/// Limit on the alternatives of a condition.
const MAX_ALTERNATIVES: usize = 4096;

/// Number that changes at a constant rate: `value` now, `rate` per unit of time.
pub(super) struct ChangingNumber {
    pub(super) value: Linear,
    pub(super) rate: Linear,
}

/// Current values, and their rates of change.
pub(super) struct StateView<'a> {
    pub(super) task: &'a Task,
    pub(super) reading: Reading<'a>,
    pub(super) rates: &'a BTreeMap<FluentId, Linear>,
    /// The nominal schedule, and the nominal values.
    pub(super) nominal: (&'a Schedule, &'a Valuation),
}

/// Time, from now, at which a condition is read in the nominal schedule.
#[derive(Clone, Copy)]
pub(super) enum ReadTime<'t> {
    At(&'t Rational),
    RightAfter(&'t Rational),
}

impl StateView<'_> {
    /// Returns the value of an expression in the nominal schedule.
    pub(super) fn nominal_value(&self, value: &Linear) -> Rational {
        value.value(self.nominal.0, self.nominal.1)
    }

    /// Returns `true` if a condition holds in the nominal schedule.
    pub(super) fn holds(&self, condition: &Condition, when: ReadTime<'_>) -> Result<bool, Refusal> {
        Ok(match condition {
            Condition::Fact(fact) => self.reading.fact(*fact)?,
            Condition::Not(part) => !self.holds(part, when)?,
            Condition::And(parts) => self.evaluate_any(parts, false, when)?,
            Condition::Or(parts) => self.evaluate_any(parts, true, when)?,
            Condition::Compare(comparison, left, right) => {
                let moving = self.difference(left, right)?;
                let rate = self.nominal_value(&moving.rate);
                let (elapsed, is_after) = match when {
                    ReadTime::At(elapsed) => (elapsed, false),
                    ReadTime::RightAfter(elapsed) => (elapsed, true),
                };
                let value = self.nominal_value(&moving.value) + &rate * elapsed;
                let value = if is_after && value.is_zero() {
                    rate
                } else {
                    value
                };
                comparison.holds(&value, &Rational::ZERO)
            }
        })
    }

    /// Returns `truth` if one of the parts has this truth value, else the other value. Parts
    /// without numbers are evaluated first, so that the numbers of the others need not be defined.
    fn evaluate_any(
        &self,
        parts: &[Condition],
        truth: bool,
        when: ReadTime<'_>,
    ) -> Result<bool, Refusal> {
        for part in facts_first(parts) {
            if self.holds(part, when)? == truth {
                return Ok(truth);
            }
        }
        Ok(!truth)
    }

    /// Returns `left - right`.
    pub(super) fn difference(
        &self,
        left: &Expression,
        right: &Expression,
    ) -> Result<ChangingNumber, Refusal> {
        let value = self.value(left)?.minus(&self.value(right)?);
        let rate = self.rate(left)?.minus(&self.rate(right)?);
        Ok(ChangingNumber { value, rate })
    }

    /// Returns the current value of an expression.
    pub(super) fn value(&self, expression: &Expression) -> Result<Linear, Refusal> {
        let value = self.reading.linear(expression)?;
        value.ok_or_else(|| self.obstacle(expression, "has no value"))
    }

    /// Returns the rate of change of an expression, if it is constant.
    fn rate(&self, expression: &Expression) -> Result<Linear, Refusal> {
        let curved = || self.obstacle(expression, "does not change at a constant rate");
        Ok(match expression {
            Expression::Constant(_) | Expression::Duration | Expression::Unknown(_) => {
                Linear::default()
            }
            Expression::Fluent(fluent) => self.rates.get(fluent).cloned().unwrap_or_default(),
            Expression::TotalTime | Expression::Violations(_) => return Err(curved()),
            Expression::Negate(part) => self.rate(part)?.scaled(&Rational::from(-1)),
            Expression::Subtract(left, right) => self.rate(left)?.minus(&self.rate(right)?),
            Expression::Add(parts) => {
                let mut sum = Linear::default();
                for part in parts {
                    sum = sum.plus(&self.rate(part)?);
                }
                sum
            }
            Expression::Multiply(parts) => {
                let mut moving = None;
                let mut factor = Linear::constant(Rational::ONE);
                for part in parts {
                    let rate = self.rate(part)?;
                    if rate == Linear::default() {
                        factor = factor.times(&self.value(part)?).ok_or_else(curved)?;
                    } else if moving.replace(rate).is_some() {
                        return Err(curved());
                    }
                }
                match moving {
                    Some(rate) => rate.times(&factor).ok_or_else(curved)?,
                    None => Linear::default(),
                }
            }
            Expression::Divide(left, right) => {
                let rate = self.rate(left)?;
                if self.rate(right)? != Linear::default() {
                    return Err(curved());
                }
                if rate == Linear::default() {
                    return Ok(rate);
                }
                let divisor = self.value(right)?;
                let factor = divisor.as_constant().and_then(Rational::reciprocal);
                rate.scaled(&factor.ok_or_else(curved)?)
            }
        })
    }

    fn obstacle(&self, expression: &Expression, what: &str) -> Refusal {
        Refusal::Autonomous {
            place: self.reading.location.to_owned(),
            obstacle: format!("{} {what}", self.task.describe_expression(expression)),
        }
    }

    /// Returns the ways in which a condition can differ from the wanted value right after now.
    pub(super) fn violations_after(
        &self,
        condition: &Condition,
        wanted: bool,
    ) -> Result<Alternatives, Refusal> {
        self.violations(condition, wanted, &|demand| {
            let SignConstraint { now, is_strict, .. } = demand;
            let rate = now.rate.as_constant();
            if now.value.as_constant().is_some_and(Rational::is_zero) {
                let rate = rate.ok_or_else(|| Refusal::Autonomous {
                    place: self.reading.location.to_owned(),
                    obstacle: "the direction in which a number leaves the bound of a condition \
                               depends on parameters"
                        .to_owned(),
                })?;
                let holds = rate.is_negative() || rate.is_zero() && !is_strict;
                return Ok(always_if(!holds));
            }
            let falls = |rate: &Rational| rate.is_negative() || rate.is_zero() && !is_strict;
            let may_be_zero = rate.is_some_and(falls);
            Ok(vec![vec![positive(&now.value, may_be_zero)]])
        })
    }

    /// Returns the ways in which a condition can differ from the wanted value at some moment of the
    /// open part from now until `then`, after `elapsed`.
    pub(super) fn violations_throughout(
        &self,
        (then, elapsed): (&StateView<'_>, &Linear),
        condition: &Condition,
        wanted: bool,
    ) -> Result<Alternatives, Refusal> {
        self.violations(condition, wanted, &|demand| {
            let (left, right) = demand.sides;
            let then = then.value(left)?.minus(&then.value(right)?);
            let then = if demand.is_negated {
                then.scaled(&Rational::from(-1))
            } else {
                then
            };
            let now = &demand.now.value;
            let mut broken = vec![vec![positive(now, true)], vec![positive(&then, true)]];
            if demand.is_strict {
                // If both happenings coincide, there is no moment between them.
                broken.push(vec![
                    positive(now, false),
                    positive(&then, false),
                    positive(elapsed, true),
                ]);
            }
            Ok(broken)
        })
    }

    /// Returns the ways in which a condition can differ from the wanted value. `leaf` computes them
    /// for an inequality.
    fn violations(
        &self,
        condition: &Condition,
        wanted: bool,
        leaf: &dyn Fn(&SignConstraint<'_>) -> Result<Alternatives, Refusal>,
    ) -> Result<Alternatives, Refusal> {
        Ok(match condition {
            Condition::Fact(fact) => always_if(self.reading.fact(*fact)? != wanted),
            Condition::Not(part) => self.violations(part, !wanted, leaf)?,
            Condition::And(parts) | Condition::Or(parts) => {
                // All parts must have the wanted value, or one of them.
                if matches!(condition, Condition::And(_)) == wanted {
                    let mut any = Vec::new();
                    for part in parts {
                        any.extend(self.violations(part, wanted, leaf)?);
                    }
                    any
                } else {
                    self.all_violations(parts, wanted, leaf)?
                }
            }
            Condition::Compare(comparison, left, right) => {
                let mut any = Vec::new();
                for demand in self.sign_constraints(*comparison, (left, right), wanted)? {
                    any.extend(leaf(&demand)?);
                }
                any
            }
        })
    }

    fn all_violations(
        &self,
        parts: &[Condition],
        wanted: bool,
        leaf: &dyn Fn(&SignConstraint<'_>) -> Result<Alternatives, Refusal>,
    ) -> Result<Alternatives, Refusal> {
        let mut product: Alternatives = vec![Vec::new()];
        for part in facts_first(parts) {
            let broken = self.violations(part, wanted, leaf)?;
            let with_more = |so_far: &Vec<Inequality>| {
                let more = broken.iter();
                more.map(|more| [&so_far[..], more].concat())
                    .collect::<Vec<_>>()
            };
            product = product.iter().flat_map(with_more).collect();
            product = product
                .into_iter()
                .filter_map(crate::obligations::dnf::drop_constants)
                .collect();
            if product.is_empty() {
                break;
            }
            if product.len() > MAX_ALTERNATIVES {
                return Err(Refusal::TooManyCases {
                    place: self.reading.location.to_owned(),
                    limit: MAX_ALTERNATIVES,
                });
            }
        }
        Ok(product)
    }

    /// Converts a comparison, or its negation, to inequalities that all have to hold. For a
    /// disequality, the nominal schedule decides which side is greater.
    fn sign_constraints<'e>(
        &self,
        comparison: Comparison,
        sides: (&'e Expression, &'e Expression),
        wanted: bool,
    ) -> Result<Vec<SignConstraint<'e>>, Refusal> {
        let moving = self.difference(sides.0, sides.1)?;
        let demand = |is_negated: bool, is_strict: bool| {
            let sign = Rational::from(if is_negated { -1 } else { 1 });
            let signed = |number: &Linear| number.scaled(&sign);
            SignConstraint {
                now: ChangingNumber {
                    value: signed(&moving.value),
                    rate: signed(&moving.rate),
                },
                sides,
                is_negated,
                is_strict,
            }
        };
        Ok(match (comparison, wanted) {
            (Comparison::Less, true) | (Comparison::AtLeast, false) => vec![demand(false, true)],
            (Comparison::AtMost, true) | (Comparison::Greater, false) => vec![demand(false, false)],
            (Comparison::AtLeast, true) | (Comparison::Less, false) => vec![demand(true, false)],
            (Comparison::Greater, true) | (Comparison::AtMost, false) => vec![demand(true, true)],
            (Comparison::Equal, true) => vec![demand(false, false), demand(true, false)],
            (Comparison::Equal, false) => {
                let now = self.nominal_value(&moving.value);
                let sign = if now.is_zero() {
                    self.nominal_value(&moving.rate)
                } else {
                    now
                };
                vec![demand(sign.is_positive(), true)]
            }
        })
    }
}

/// Number that must be at most zero, or negative.
struct SignConstraint<'e> {
    now: ChangingNumber,
    /// The number is the difference of these, or its negation.
    sides: (&'e Expression, &'e Expression),
    is_negated: bool,
    is_strict: bool,
}

/// Returns `number > 0`, or `number >= 0`.
fn positive(number: &Linear, is_strict: bool) -> Inequality {
    Inequality {
        expression: number.scaled(&Rational::from(-1)),
        is_strict,
    }
}

/// Returns the parts, those without numbers first.
fn facts_first(parts: &[Condition]) -> impl Iterator<Item = &Condition> {
    let has_numbers = |part: &&Condition| {
        let mut has = false;
        part.visit_comparisons(&mut |_, _| has = true);
        has
    };
    let facts = parts.iter().filter(move |part| !has_numbers(part));
    facts.chain(parts.iter().filter(has_numbers))
}
