//! Regression: conditions before a happening that are needed for conditions after it.
//!
//! The layers are those of the pruned network: a fact that an effect sets is not needed before it,
//! and a fact that is needed later is needed in all layers between. Conditions that couple facts or
//! read numbers are regressed by substitution. A condition on a number that changes continuously in
//! between is not regressed any further.

use std::collections::BTreeSet;

use elbowroom_model::ground::{Condition, Expression, FactId, FluentId};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_plan::{InstanceId, NodeId};

use super::Layer;
use crate::model::{Event, Model, Requirement, is_fact};

/// Regressed conditions of one layer.
#[derive(Clone, Debug, Default)]
struct Needed {
    literals: BTreeSet<(usize, bool)>,
    conditions: Vec<Condition>,
}

/// Returns the layers of a sequence; `under_way` has the running actions of each. In layers between
/// happenings of one moment, over-all conditions are not required.
pub(super) fn layers(
    model: &Model,
    (sequence, joined): (&[NodeId], &[bool]),
    under_way: Vec<Vec<InstanceId>>,
) -> Vec<Layer> {
    let mut needed = Needed::default();
    needed.include(&model.goal);
    let mut layers = Vec::with_capacity(under_way.len());
    let mut happenings = sequence.iter().rev();
    for (position, running) in under_way.into_iter().enumerate().rev() {
        if joined.get(position) != Some(&true) {
            for id in &running {
                needed.include(&model.event(model.start(*id)).over_all);
            }
        }
        layers.push(needed.layer(model, running));
        if let Some(&node) = happenings.next() {
            needed = needed.before(model, model.event(node));
        }
    }
    layers.reverse();
    layers
}

impl Needed {
    fn include(&mut self, requirement: &Requirement) {
        self.literals.extend(&requirement.literals);
        let coupled = requirement.coupled.iter().map(|coupled| &coupled.condition);
        for condition in requirement.numeric.iter().chain(coupled) {
            if !self.conditions.contains(condition) {
                self.conditions.push(condition.clone());
            }
        }
    }

    /// Returns the conditions on arrival at a happening.
    fn before(&self, model: &Model, event: &Event) -> Self {
        let mut before = Self::default();
        for &(fact, truth) in &self.literals {
            let mut effects = event.effects.iter().filter(|effect| effect.fact == fact);
            let mut all = effects.clone();
            if effects.any(|effect| effect.guard.is_none()) {
                continue;
            }
            if all.next().is_none() {
                before.literals.insert((fact, truth));
            } else {
                let after = after(model, event, model.facts[fact]);
                before.conditions.push(if truth {
                    after
                } else {
                    Condition::Not(Box::new(after))
                });
            }
        }
        for condition in &self.conditions {
            if let Some(condition) = regressed(model, event, condition) {
                before.conditions.push(condition);
            }
        }
        before.include(&event.condition);
        before
    }

    fn layer(&self, model: &Model, running: Vec<InstanceId>) -> Layer {
        let literals = self.literals.iter();
        let literals = literals.map(|&(fact, truth)| (model.facts[fact], truth));
        let mut conditions: Vec<Condition> = Vec::new();
        for condition in &self.conditions {
            let condition = without_memories(condition);
            if !condition.is_trivial() && !conditions.contains(&condition) {
                conditions.push(condition);
            }
        }
        Layer {
            literals: literals.filter(|(fact, _)| is_fact(*fact)).collect(),
            conditions,
            running,
        }
    }
}

/// Returns the condition before a happening under which a fact is true after it.
fn after(model: &Model, event: &Event, fact: FactId) -> Condition {
    let Some(position) = model.position(fact) else {
        return Condition::Fact(fact);
    };
    let guards = |makes_true: bool| {
        let effects = event.effects.iter();
        let own = effects.filter(move |e| e.fact == position && e.makes_true == makes_true);
        own.map(|effect| effect.guard.clone().unwrap_or(Condition::TRUE))
            .collect::<Vec<_>>()
    };
    let (added, deleted) = (guards(true), guards(false));
    let kept = if deleted.is_empty() {
        Condition::Fact(fact)
    } else {
        let not_deleted = Condition::Not(Box::new(Condition::Or(deleted)));
        Condition::And(vec![Condition::Fact(fact), not_deleted])
    };
    if added.is_empty() {
        return kept;
    }
    let mut either = added;
    either.push(kept);
    Condition::Or(either)
}

/// Returns the condition before a happening; `None` if it cannot be regressed.
fn regressed(model: &Model, event: &Event, condition: &Condition) -> Option<Condition> {
    let of_all = |parts: &[Condition]| {
        let parts = parts.iter();
        parts
            .map(|part| regressed(model, event, part))
            .collect::<Option<Vec<_>>>()
    };
    Some(match condition {
        Condition::Fact(fact) => {
            let mut basic = Vec::new();
            crate::model::visit_facts(model.task(), condition, &mut |fact| basic.push(fact));
            if basic.as_slice() == [*fact] {
                after(model, event, *fact)
            } else {
                // A derived fact is unchanged if all facts that it depends on are unchanged.
                let is_touched = |fact: &FactId| {
                    let position = model.position(*fact);
                    event
                        .effects
                        .iter()
                        .any(|effect| Some(effect.fact) == position)
                };
                if basic.iter().any(is_touched) {
                    return None;
                }
                condition.clone()
            }
        }
        Condition::Not(part) => Condition::Not(Box::new(regressed(model, event, part)?)),
        Condition::And(parts) => Condition::And(of_all(parts)?),
        Condition::Or(parts) => Condition::Or(of_all(parts)?),
        Condition::Compare(comparison, left, right) => {
            let mut is_lost = false;
            let mut side = |side: &Expression| {
                side.map_leaves(&mut |leaf| match leaf {
                    Expression::Fluent(fluent) => {
                        let changed = value_after(model, event, *fluent);
                        is_lost |= changed.is_err();
                        changed.ok().flatten()
                    }
                    _ => None,
                })
            };
            let compared = Condition::Compare(*comparison, side(left), side(right));
            if is_lost {
                return None;
            }
            compared
        }
    })
}

/// The value of a number cannot be determined from values before.
struct Undetermined;

/// Returns a fluent's value after a happening as an expression over values before; `None` if it
/// does not change.
fn value_after(
    model: &Model,
    event: &Event,
    fluent: FluentId,
) -> Result<Option<Expression>, Undetermined> {
    let Some(position) = model.fluent_position(fluent) else {
        return Ok(None);
    };
    if event
        .continuous
        .iter()
        .any(|(changed, _)| *changed == position)
    {
        return Err(Undetermined);
    }
    let mut value: Option<Expression> = None;
    for update in event
        .updates
        .iter()
        .filter(|update| update.fluent == position)
    {
        if update.guard.is_some() {
            return Err(Undetermined);
        }
        let mut is_lost = false;
        let amount = update.value.map_leaves(&mut |leaf| match leaf {
            Expression::Duration => {
                let duration = event.duration.clone();
                is_lost |= duration.is_none();
                duration.map(Expression::Constant)
            }
            _ => None,
        });
        if is_lost {
            return Err(Undetermined);
        }
        let old = value.take().unwrap_or(Expression::Fluent(fluent));
        value = Some(match update.operator {
            UpdateOperator::Assign => amount,
            UpdateOperator::Increase => Expression::Add(vec![old, amount]),
            UpdateOperator::Decrease => Expression::Subtract(Box::new(old), Box::new(amount)),
            UpdateOperator::ScaleUp => Expression::Multiply(vec![old, amount]),
            UpdateOperator::ScaleDown => Expression::Divide(Box::new(old), Box::new(amount)),
        });
    }
    Ok(value)
}

/// Returns the condition without memories, which only the network has: an effect that depends on
/// one is assumed to take place.
fn without_memories(condition: &Condition) -> Condition {
    let of_all = |parts: &[Condition]| parts.iter().map(without_memories).collect();
    match condition {
        Condition::Fact(fact) if !is_fact(*fact) => Condition::TRUE,
        Condition::Fact(_) | Condition::Compare(..) => condition.clone(),
        Condition::Not(part) => Condition::Not(Box::new(without_memories(part))),
        Condition::And(parts) => Condition::And(of_all(parts)),
        Condition::Or(parts) => Condition::Or(of_all(parts)),
    }
}
