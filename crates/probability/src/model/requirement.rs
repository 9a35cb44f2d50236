//! Conditions cut into parts: single facts, numbers, and what couples facts.

use elbowroom_model::Task;
use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

/// A conjunction, by what its parts read.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Requirement {
    /// Facts with the truth they must have, sorted.
    pub(crate) literals: Vec<(usize, bool)>,
    /// The conditions that read numbers only.
    pub(crate) numeric: Vec<Condition>,
    /// Everything else.
    pub(crate) coupled: Vec<Coupled>,
}

/// A condition on several facts at once, such as a disjunction, or a derived fact.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Coupled {
    pub(crate) condition: Condition,
    /// The basic facts (and memories) that it reads, sorted.
    pub(crate) facts: Vec<usize>,
}

impl Requirement {
    /// Cuts a condition up. `position` numbers facts.
    pub(crate) fn of(
        task: &Task,
        condition: &Condition,
        position: &dyn Fn(FactId) -> usize,
    ) -> Self {
        let mut requirement = Self::default();
        for part in negations_inwards(condition, true).conjuncts() {
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

/// Whether rules define the fact. Memories have ids that no task gives.
pub(crate) fn is_derived(task: &Task, fact: FactId) -> bool {
    fact < FactId::FIRST_FREE && task.is_derived(fact)
}

/// Calls `visit` for each basic fact and memory that the condition reads, also through rules.
pub(crate) fn visit_facts(task: &Task, condition: &Condition, visit: &mut impl FnMut(FactId)) {
    condition.visit_facts(&mut |fact| {
        if is_derived(task, fact) {
            task.visit_facts_of(&Condition::Fact(fact), visit);
        } else {
            visit(fact);
        }
    });
}

/// The same condition with `Not` only around facts and comparisons.
pub(crate) fn negations_inwards(condition: &Condition, is_positive: bool) -> Condition {
    let all = |parts: &[Condition]| {
        let parts = parts.iter();
        parts
            .map(|part| negations_inwards(part, is_positive))
            .collect()
    };
    match condition {
        Condition::Not(part) => negations_inwards(part, !is_positive),
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

/// Whether a condition holds, the truth of basic facts and the values of fluents being given.
///
/// # Errors
/// When that rests on a number that is not known.
pub(crate) fn evaluate(
    task: &Task,
    condition: &Condition,
    truth: &dyn Fn(FactId) -> bool,
    value: &dyn Fn(&Expression) -> Option<Rational>,
) -> Result<bool, UnknownNumber> {
    let basic = Basic { truth, value };
    match task.derivation() {
        Some(derivation) if derivation.is_read_by(condition) => {
            let derived = derivation.derive(&basic);
            holds(condition, &derivation.on_top_of(&basic, &derived))
        }
        _ => holds(condition, &basic),
    }
}

/// A condition rests on a number that is not known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct UnknownNumber;

struct Basic<'a> {
    truth: &'a dyn Fn(FactId) -> bool,
    value: &'a dyn Fn(&Expression) -> Option<Rational>,
}

impl Moment<UnknownNumber> for Basic<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, UnknownNumber> {
        Ok((self.truth)(fact))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, UnknownNumber> {
        let value = |side: &Expression| side.evaluate(&mut |leaf| (self.value)(leaf));
        match (value(left), value(right)) {
            (Some(left), Some(right)) => Ok(comparison.holds(&left, &right)),
            _ => Err(UnknownNumber),
        }
    }
}
