//! Effects of happenings on facts and numbers.

use elbowroom_model::ground::{Condition, Expression};
use elbowroom_num::Rational;
use elbowroom_plan::{InstanceId, Node, NodeId};

use super::numbers::{Number, Numbers};
use super::outcome::{Outcome, Pending};
use super::{PrunedNetwork, TooCoupled, Undo};
use crate::model::{Event, Value};

impl PrunedNetwork<'_> {
    /// Returns the numbers after a happening.
    pub(super) fn updates(&mut self, node: NodeId, event: &Event) -> Vec<(usize, Number)> {
        let model = self.model;
        if event.updates.is_empty() && event.continuous.is_empty() {
            return Vec::new();
        }
        let mut after: Vec<(usize, Number)> = Vec::new();
        let duration = event.duration.as_ref();
        for update in &event.updates {
            let certain = match &update.guard {
                None => Some(true),
                Some(guard) => self.truth(guard),
            };
            let leaf = |leaf: &Expression| self.numbers.value(model, leaf, duration);
            let amount = Value::of(&update.value, &leaf);
            let present = present(&after, &self.numbers, update.fluent);
            let next = match certain {
                Some(false) => continue,
                Some(true) => Numbers::updated(&present, update.operator, amount),
                None => Numbers::maybe_updated(&present),
            };
            set_value(&mut after, update.fluent, next);
        }
        let end_of = match model.plan().nodes[node.index()] {
            Node::End(id) => Some(id),
            _ => None,
        };
        for (fluent, rate) in &event.continuous {
            let present = present(&after, &self.numbers, *fluent);
            let next = match end_of {
                None => Numbers::after_effect_start(&present),
                Some(id) => {
                    let lasted = self.remaining_duration(id).or(event.duration.clone());
                    let leaf = |leaf: &Expression| self.numbers.value(model, leaf, duration);
                    let amount = match (Value::of(rate, &leaf), lasted) {
                        (Value::Known(rate), Some(lasted)) => Value::Known(rate * lasted),
                        _ => Value::TimeDependent,
                    };
                    Numbers::after_effect_end(&present, amount)
                }
            };
            set_value(&mut after, *fluent, next);
        }
        after
    }

    /// Returns the remaining duration of an action that was running initially, counted from the
    /// initial time.
    fn remaining_duration(&self, id: InstanceId) -> Option<Rational> {
        let is_first_end = |node: &NodeId| self.model.plan().nodes[node.index()] == Node::End(id);
        if self.sequence.iter().any(is_first_end) {
            return None;
        }
        let known = self.remaining.iter().find(|(running, _)| *running == id)?;
        known.1.clone()
    }

    pub(super) fn set_number(&mut self, fluent: usize, number: Number) {
        let old = std::mem::replace(&mut self.numbers.changing[fluent], number);
        self.undo.push(Undo::Number(fluent, old));
    }

    /// Applies the effects of a happening on facts, and spontaneous changes.
    pub(super) fn apply_fact_effects(
        &mut self,
        node: NodeId,
        event: &Event,
    ) -> Result<(), TooCoupled> {
        let model = self.model;
        let mut uncertain = Vec::new();
        let mut certain = Vec::new();
        for effect in &event.effects {
            let outcome = Outcome::from(effect);
            let Some(guard) = &effect.guard else {
                certain.push(outcome);
                continue;
            };
            match self.truth(guard) {
                Some(true) => certain.push(outcome),
                Some(false) => {}
                None => uncertain.push((Some(guard.clone()), outcome)),
            }
        }
        if uncertain.is_empty() {
            self.facts.apply(model, &certain, event.is_step);
            return Ok(());
        }
        // Certain and uncertain effects on one fact have to be applied together.
        let is_open = |fact: usize| uncertain.iter().any(|(_, outcome)| outcome.fact == fact);
        let (joint, apart): (Vec<_>, Vec<_>) = certain
            .into_iter()
            .partition(|outcome| is_open(outcome.fact));
        uncertain.extend(joint.into_iter().map(|outcome| (None, outcome)));
        let pending = Pending {
            independent: apart,
            is_step: event.is_step,
        };
        self.transform_facts_with(node, &uncertain, &pending)
    }

    pub(super) fn transform_facts(
        &mut self,
        node: NodeId,
        guarded: &[(Option<Condition>, Outcome)],
        is_step: bool,
    ) -> Result<(), TooCoupled> {
        let pending = Pending {
            independent: Vec::new(),
            is_step,
        };
        self.transform_facts_with(node, guarded, &pending)
    }

    fn transform_facts_with(
        &mut self,
        node: NodeId,
        guarded: &[(Option<Condition>, Outcome)],
        pending: &Pending,
    ) -> Result<(), TooCoupled> {
        let (model, numbers) = (self.model, &self.numbers);
        let value = |leaf: &Expression| numbers.value(model, leaf, None);
        let changed = self.facts.apply_guarded(model, guarded, pending, &value);
        changed.map_err(|count| self.too_coupled(node, count))
    }
}

fn present(after: &[(usize, Number)], numbers: &Numbers, fluent: usize) -> Number {
    let found = after.iter().find(|(other, _)| *other == fluent);
    found.map_or_else(
        || numbers.changing[fluent].clone(),
        |(_, number)| number.clone(),
    )
}

fn set_value(after: &mut Vec<(usize, Number)>, fluent: usize, number: Number) {
    match after.iter_mut().find(|(other, _)| *other == fluent) {
        Some((_, old)) => *old = number,
        None => after.push((fluent, number)),
    }
}
