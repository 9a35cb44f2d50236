//! Facts and numbers at one moment of a plan: [`PointState`].

use std::cell::OnceCell;
use std::collections::BTreeMap;

use elbowroom_model::derivation::{Derived, Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_model::problem::{Comparison, Unknown};
use elbowroom_num::Rational;

use super::NotDerived;
use super::histories::{ContinuousId, FluentChange, Histories, Undetermined, Value};
use super::linear::{Inequality, Linear};

/// The limit on alternatives of one condition.
const MAX_ALTERNATIVES: usize = 1024;

/// Facts and numbers at one moment.
pub(super) struct PointState<'r> {
    pub(super) histories: &'r Histories<'r>,
    pub(super) has_happened: &'r dyn Fn(usize) -> bool,
    pub(super) time: Linear,
    /// `?duration`
    pub(super) duration: Option<Linear>,
    pub(super) derived: OnceCell<Option<Derived<Undetermined>>>,
}

impl PointState<'_> {
    /// Returns `true` if the condition holds in all schedules.
    ///
    /// # Errors
    /// When the truth value differs between schedules, or is unknown.
    pub(super) fn holds(&self, condition: &Condition) -> Result<bool, Undetermined> {
        holds(condition, self)
    }

    /// Returns the alternatives for a condition to be true or false. Each is a conjunction of inequalities.
    ///
    /// # Errors
    /// When a number has no value, or is not known.
    pub(super) fn alternatives(
        &self,
        condition: &Condition,
        wanted: bool,
    ) -> Result<Vec<Vec<Inequality>>, NotDerived> {
        let unknown = || {
            let what = self.histories.subject.task.describe_condition(condition);
            NotDerived::Unknown(format!("the numbers in {what}"))
        };
        match condition {
            Condition::Fact(fact) => {
                let truth = Moment::fact(self, *fact).map_err(|_| unknown())?;
                Ok(if truth == wanted {
                    vec![Vec::new()]
                } else {
                    Vec::new()
                })
            }
            Condition::Not(part) => self.alternatives(part, !wanted),
            Condition::And(parts) | Condition::Or(parts) => {
                let is_all = matches!(condition, Condition::And(_)) == wanted;
                let mut found = if is_all { vec![Vec::new()] } else { Vec::new() };
                for part in parts {
                    let more = self.alternatives(part, wanted)?;
                    found = if is_all {
                        let pairs = found.iter().flat_map(|one: &Vec<Inequality>| {
                            more.iter().map(move |other| [&one[..], other].concat())
                        });
                        pairs.collect()
                    } else {
                        [found, more].concat()
                    };
                    if found.len() > MAX_ALTERNATIVES {
                        return Err(unknown());
                    }
                }
                Ok(found)
            }
            Condition::Compare(comparison, left, right) => {
                let (Value::Known(left), Value::Known(right)) =
                    (self.expression(left), self.expression(right))
                else {
                    return Err(unknown());
                };
                Ok(compared(*comparison, &left.minus(&right), wanted))
            }
        }
    }

    /// Returns the value of a fluent.
    pub(super) fn fluent(&self, fluent: FluentId) -> Value {
        let Histories {
            subject,
            places,
            fluents,
            ..
        } = self.histories;
        let initial = subject.task.initial().values.get(&fluent);
        let mut value = match (subject.initials.get(&fluent), initial) {
            (Some(parameter), _) => Value::Known(Linear::parameter(*parameter)),
            (None, Some(value)) => Value::Known(Linear::number(value.clone())),
            (None, None) => Value::Undefined,
        };
        let mut rates: BTreeMap<ContinuousId, &Value> = BTreeMap::new();
        let mut since = Linear::default();
        for (point, change) in fluents.get(&fluent).map_or(&[][..], Vec::as_slice) {
            if !(self.has_happened)(*point) {
                continue;
            }
            let time = places.time(*point);
            value = advanced(value, &rates, &time.minus(&since));
            since = time;
            match change {
                FluentChange::Set(amount) => value = amount.clone(),
                FluentChange::Shift(amount) => value = sum(&value, amount),
                FluentChange::Starts(id, rate) => {
                    rates.insert(*id, rate);
                }
                FluentChange::Ends(id) => {
                    rates.remove(id);
                }
            }
        }
        advanced(value, &rates, &self.time.minus(&since))
    }

    /// Returns the value of an expression.
    pub(super) fn expression(&self, expression: &Expression) -> Value {
        let number = |number: Rational| Value::Known(Linear::number(number));
        match expression {
            Expression::Constant(constant) => number(constant.clone()),
            Expression::Fluent(fluent) => self.fluent(*fluent),
            Expression::Duration => self.duration.clone().map_or(Value::Unknown, Value::Known),
            Expression::Add(parts) => parts
                .iter()
                .map(|part| self.expression(part))
                .fold(number(Rational::ZERO), |total, part| sum(&total, &part)),
            Expression::Multiply(parts) => parts
                .iter()
                .map(|part| self.expression(part))
                .fold(number(Rational::ONE), |product, part| {
                    combined(&product, &part, Linear::product)
                }),
            Expression::Subtract(left, right) => {
                sum(&self.expression(left), &negated(self.expression(right)))
            }
            Expression::Divide(left, right) => {
                let (left, right) = (self.expression(left), self.expression(right));
                let is_zero = |right: &Linear| right.as_number().is_some_and(Rational::is_zero);
                match &right {
                    Value::Known(right) if is_zero(right) => Value::Undefined,
                    _ => combined(&left, &right, quotient),
                }
            }
            Expression::Negate(part) => negated(self.expression(part)),
            Expression::Unknown(Unknown::Parameter(parameter)) => {
                Value::Known(Linear::parameter(*parameter as usize))
            }
            Expression::TotalTime | Expression::Violations(_) | Expression::Unknown(_) => {
                Value::Unknown
            }
        }
    }

    /// Returns the truth of a fact that no rule defines.
    fn basic_fact(&self, fact: FactId) -> bool {
        let Histories { subject, facts, .. } = self.histories;
        let settings = facts.get(&fact).map_or(&[][..], Vec::as_slice);
        let last = settings
            .iter()
            .rev()
            .find(|(point, _)| (self.has_happened)(*point));
        last.map_or_else(
            || subject.task.initial().facts.contains(&fact),
            |(_, truth)| *truth,
        )
    }

    fn compared(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Undetermined> {
        match (self.expression(left), self.expression(right)) {
            (Value::Undefined, _) | (_, Value::Undefined) => Err(Undetermined::Undefined),
            (Value::Known(left), Value::Known(right)) => match left.minus(&right).as_number() {
                Some(difference) => Ok(comparison.holds(difference, &Rational::ZERO)),
                None => Err(Undetermined::Varying),
            },
            _ => Err(Undetermined::Varying),
        }
    }
}

impl Moment<Undetermined> for PointState<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Undetermined> {
        let task = self.histories.subject.task;
        if !task.is_derived(fact) {
            return Ok(self.basic_fact(fact));
        }
        let derived = self.derived.get_or_init(|| {
            let derivation = task.derivation()?;
            Some(derivation.derive(&Basic(self)))
        });
        let derived = derived.as_ref().ok_or(Undetermined::Undefined)?;
        derived.truth(fact)
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Undetermined> {
        self.compared(comparison, left, right)
    }
}

/// A moment without the facts that rules define.
struct Basic<'r>(&'r PointState<'r>);

impl Moment<Undetermined> for Basic<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Undetermined> {
        Ok(self.0.basic_fact(fact))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Undetermined> {
        self.0.compared(comparison, left, right)
    }
}

pub(super) fn negated(value: Value) -> Value {
    match value {
        Value::Known(value) => Value::Known(value.scaled(&Rational::from(-1))),
        other => other,
    }
}

fn sum(left: &Value, right: &Value) -> Value {
    combined(left, right, |left, right| Some(left.plus(right)))
}

pub(super) fn combined(
    left: &Value,
    right: &Value,
    combine: impl Fn(&Linear, &Linear) -> Option<Linear>,
) -> Value {
    match (left, right) {
        (Value::Undefined, _) | (_, Value::Undefined) => Value::Undefined,
        (Value::Known(left), Value::Known(right)) => {
            combine(left, right).map_or(Value::Unknown, Value::Known)
        }
        _ => Value::Unknown,
    }
}

/// Returns the quotient, or `None` if the divisor is not a nonzero number.
pub(super) fn quotient(left: &Linear, right: &Linear) -> Option<Linear> {
    let inverse = Rational::ONE.checked_div(right.as_number()?)?;
    Some(left.scaled(&inverse))
}

/// Returns a value after some time of continuous change.
fn advanced(value: Value, rates: &BTreeMap<ContinuousId, &Value>, time: &Linear) -> Value {
    let elapsed = Value::Known(time.clone());
    rates.values().fold(value, |value, rate| {
        sum(&value, &combined(rate, &elapsed, Linear::product))
    })
}

/// Returns the alternatives for `difference comparison 0` to be true or false. Inequalities between numbers are
/// decided.
pub(super) fn compared(
    comparison: Comparison,
    difference: &Linear,
    wanted: bool,
) -> Vec<Vec<Inequality>> {
    if let Some(number) = difference.as_number() {
        let is_so = comparison.holds(number, &Rational::ZERO) == wanted;
        return if is_so { vec![Vec::new()] } else { Vec::new() };
    }
    let below = |is_strict| Inequality {
        expression: difference.clone(),
        is_strict,
    };
    let above = |is_strict| Inequality {
        expression: difference.scaled(&Rational::from(-1)),
        is_strict,
    };
    match (comparison, wanted) {
        (Comparison::Less, true) | (Comparison::AtLeast, false) => vec![vec![below(true)]],
        (Comparison::AtMost, true) | (Comparison::Greater, false) => vec![vec![below(false)]],
        (Comparison::AtLeast, true) | (Comparison::Less, false) => vec![vec![above(false)]],
        (Comparison::Greater, true) | (Comparison::AtMost, false) => vec![vec![above(true)]],
        (Comparison::Equal, true) => vec![vec![below(false), above(false)]],
        (Comparison::Equal, false) => vec![vec![below(true)], vec![above(true)]],
    }
}
