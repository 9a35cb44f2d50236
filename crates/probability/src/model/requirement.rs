//! Decomposition of conditions: single facts, numbers, and parts that couple facts.

use elbowroom_model::Task;
use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

/// A conjunction, split into the parts that read facts and those that read numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Requirement {
    /// Facts with the required truth values, sorted.
    pub(crate) literals: Vec<(usize, bool)>,
    /// Conditions that only read numbers.
    pub(crate) numeric: Vec<Condition>,
    /// All other conditions.
    pub(crate) coupled: Vec<Coupled>,
}

/// A condition on several facts at once, such as a disjunction, or a derived fact.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coupled {
    pub(crate) condition: Condition,
    /// Basic facts (and memories) that it reads, sorted.
    pub(crate) facts: Vec<usize>,
}

impl Requirement {
    /// Splits a condition. `position` numbers facts.
    pub(crate) fn of(
        task: &Task,
        condition: &Condition,
        position: &dyn Fn(FactId) -> usize,
    ) -> Self {
        let mut requirement = Self::default();
        for part in negation_normal_form(condition, true).conjuncts() {
            match part {
                Condition::Fact(fact) if !is_derived(task, *fact) => {
                    requirement.literals.push((position(*fact), true));
                }
                Condition::Not(inner) if matches!(**inner, Condition::Fact(fact) if !is_derived(task, fact)) => {
                    if let Condition::Fact(fact) = **inner {
                        requirement.literals.push((position(fact), false));
                    }
                }
                part => {
                    let mut facts = Vec::new();
                    visit_facts(task, part, &mut |fact| facts.push(position(fact)));
                    facts.sort_unstable();
                    facts.dedup();
                    let mut mentions_facts = false;
                    part.visit_facts(&mut |_| mentions_facts = true);
                    if mentions_facts {
                        requirement.coupled.push(Coupled {
                            condition: part.clone(),
                            facts,
                        });
                    } else {
                        requirement.numeric.push(part.clone());
                    }
                }
            }
        }
        requirement.literals.sort_unstable();
        requirement.literals.dedup();
        requirement
    }
}

/// Returns `true` if rules define the fact. Memories have ids that no task assigns.
pub(crate) fn is_derived(task: &Task, fact: FactId) -> bool {
    fact < FactId::FIRST_FREE && task.is_derived(fact)
}

/// Calls `visit` for each basic fact and memory that the condition reads, including through rules.
pub(crate) fn visit_facts(task: &Task, condition: &Condition, visit: &mut impl FnMut(FactId)) {
    condition.visit_facts(&mut |fact| {
        if is_derived(task, fact) {
            task.visit_facts_of(&Condition::Fact(fact), visit);
        } else {
            visit(fact);
        }
    });
}

/// Returns the condition with `Not` only around facts and comparisons.
pub(crate) fn negation_normal_form(condition: &Condition, is_positive: bool) -> Condition {
    let all = |parts: &[Condition]| {
        let parts = parts.iter();
        parts
            .map(|part| negation_normal_form(part, is_positive))
            .collect()
    };
    match condition {
        Condition::Not(part) => negation_normal_form(part, !is_positive),
        Condition::And(parts) if is_positive => Condition::And(all(parts)),
        Condition::Or(parts) if !is_positive => Condition::And(all(parts)),
        Condition::And(parts) | Condition::Or(parts) => match all(parts) {
            mut parts if parts.len() == 1 => parts.remove(0),
            parts => Condition::Or(parts),
        },
        leaf if is_positive => leaf.clone(),
        leaf => Condition::Not(Box::new(leaf.clone())),
    }
}

/// Value of a number.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Value {
    /// No value: the fluent was never assigned, or a divisor is zero.
    Undefined,
    /// It depends on times, not only on the order of happenings.
    TimeDependent,
    /// A known value.
    Known(Rational),
}

impl From<Option<&Rational>> for Value {
    /// Converts the value of a fluent in a state.
    fn from(value: Option<&Rational>) -> Self {
        value.map_or(Self::Undefined, |value| Self::Known(value.clone()))
    }
}

impl Value {
    /// Returns the value of an expression, with the values of its leaves from `leaf`.
    pub(crate) fn of(expression: &Expression, leaf: &dyn Fn(&Expression) -> Self) -> Self {
        let mut is_open = false;
        let value = expression.evaluate(&mut |part| match leaf(part) {
            Self::Known(value) => Some(value),
            other => {
                is_open |= other == Self::TimeDependent;
                None
            }
        });
        match value {
            Some(value) => Self::Known(value),
            // The evaluation stops at the first leaf that is not known.
            None if is_open && !reads_undefined(expression, leaf) => Self::TimeDependent,
            None => Self::Undefined,
        }
    }
}

/// Returns `true` if the expression reads a fluent without a value.
fn reads_undefined(expression: &Expression, leaf: &dyn Fn(&Expression) -> Value) -> bool {
    let mut is_undefined = false;
    expression.visit_fluents(&mut |fluent| {
        is_undefined |= leaf(&Expression::Fluent(fluent)) == Value::Undefined;
    });
    is_undefined
}

/// Evaluates a condition with the given truth values of basic facts and values of fluents. A
/// comparison that reads a fluent without a value does not hold, and neither does its negation.
///
/// # Errors
/// When the result depends on a number that depends on times.
pub(crate) fn evaluate(
    task: &Task,
    condition: &Condition,
    truth: &dyn Fn(FactId) -> bool,
    value: &dyn Fn(&Expression) -> Value,
) -> Result<bool, TimeDependent> {
    let basic = BasicContext { truth, value };
    let read = |condition: &Condition| match task.derivation() {
        Some(derivation) if derivation.is_read_by(condition) => {
            let derived = derivation.derive(&basic);
            holds(condition, &derivation.with_derived_facts(&basic, &derived))
        }
        _ => holds(condition, &basic),
    };
    match read(condition) {
        Ok(holds) => Ok(holds),
        Err(_) => match read(&without_undefined(condition, true, value)) {
            Ok(holds) => Ok(holds),
            Err(Fault::TimeDependent) => Err(TimeDependent),
            // A rule of a derived fact reads a fluent without a value.
            Err(Fault::Undefined) => Ok(false),
        },
    }
}

/// Returns the condition with each comparison that reads a fluent without a value replaced by a
/// constant that makes the condition false.
fn without_undefined(
    condition: &Condition,
    is_positive: bool,
    value: &dyn Fn(&Expression) -> Value,
) -> Condition {
    let all = |parts: &[Condition]| {
        let parts = parts.iter();
        parts
            .map(|part| without_undefined(part, is_positive, value))
            .collect()
    };
    match condition {
        Condition::Fact(fact) => Condition::Fact(*fact),
        Condition::Compare(_, left, right) => {
            let is_undefined = |side: &Expression| Value::of(side, value) == Value::Undefined;
            match (is_undefined(left) || is_undefined(right), is_positive) {
                (false, _) => condition.clone(),
                (true, true) => Condition::FALSE,
                (true, false) => Condition::TRUE,
            }
        }
        Condition::Not(part) => {
            Condition::Not(Box::new(without_undefined(part, !is_positive, value)))
        }
        Condition::And(parts) => Condition::And(all(parts)),
        Condition::Or(parts) => Condition::Or(all(parts)),
    }
}

/// The result of a condition depends on a number that depends on times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimeDependent;

/// Reason why a comparison is neither true nor false.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Undefined,
    TimeDependent,
}

struct BasicContext<'a> {
    truth: &'a dyn Fn(FactId) -> bool,
    value: &'a dyn Fn(&Expression) -> Value,
}

impl Moment<Fault> for BasicContext<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Fault> {
        Ok((self.truth)(fact))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Fault> {
        let value = |side: &Expression| Value::of(side, self.value);
        match (value(left), value(right)) {
            (Value::Known(left), Value::Known(right)) => Ok(comparison.holds(&left, &right)),
            (Value::Undefined, _) | (_, Value::Undefined) => Err(Fault::Undefined),
            _ => Err(Fault::TimeDependent),
        }
    }
}
