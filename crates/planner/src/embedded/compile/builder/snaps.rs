//! One happening of an action, with its effects.

use elbowroom_model::ground::{self, Change as ModelChange};

use super::super::{Change, Conditional, Snap, Update};
use super::Builder;
use crate::embedded::compile::is_conflict;
use crate::embedded::formula::Formula;

impl Builder<'_> {
    /// Compiles a happening. The conditions that its effects read at the action's start are added
    /// to the guards.
    pub(super) fn snap(&mut self, body: &ground::SnapAction, guards: &mut Vec<Formula>) -> Snap {
        let mut snap = Snap {
            condition: self.symbols.formula(&body.condition),
            ..Snap::default()
        };
        let mut costs = Vec::new();
        for effect in &body.effects {
            let is_unconditional = effect.guard.is_trivial();
            if is_unconditional && let Some(cost) = self.cost(&effect.change) {
                costs.push(cost);
                continue;
            }
            let Some(change) = self.change(&effect.change) else {
                continue;
            };
            if is_unconditional {
                match change {
                    Change::Add(fact) => snap.adds.push(fact),
                    Change::Delete(fact) => snap.deletes.push(fact),
                    Change::Update(update) => snap.updates.push(update),
                    Change::Cost(_) => {}
                }
                continue;
            }
            let at_start = (!effect.guard.at_start.is_trivial()).then(|| {
                guards.push(self.symbols.formula(&effect.guard.at_start));
                u8::try_from(guards.len() - 1).unwrap_or(u8::MAX)
            });
            let now = self.symbols.formula(&effect.guard.now);
            snap.conditional.push(Conditional {
                at_start,
                now,
                change,
            });
        }
        if !costs.is_empty() {
            let sum = ground::Expression::Add(costs);
            snap.cost = Some(self.symbols.numeric(&sum));
        }
        if is_conflict(&snap.updates) {
            // A choice without alternatives never holds.
            snap.condition.choices.push(Vec::new());
        }
        // An addition wins over a deletion by the same happening.
        let adds = std::mem::take(&mut snap.adds);
        snap.deletes.retain(|fact| !adds.contains(fact));
        snap.adds = adds;
        snap
    }

    /// Returns the effect of a change on the search's numbers, if there is any.
    fn change(&mut self, change: &ModelChange) -> Option<Change> {
        match change {
            ModelChange::Add(fact) => self.symbols.known_fact(*fact).map(Change::Add),
            ModelChange::Delete(fact) => self.symbols.known_fact(*fact).map(Change::Delete),
            ModelChange::Update {
                operator,
                fluent,
                value,
            } => {
                let Some(fluent) = self.symbols.known_fluent(*fluent) else {
                    let cost = self.cost(change)?;
                    return Some(Change::Cost(self.symbols.numeric(&cost)));
                };
                Some(Change::Update(Update {
                    fluent,
                    operator: *operator,
                    value: self.symbols.numeric(value),
                }))
            }
        }
    }

    /// Returns the amount that a change adds to the metric's sum.
    fn cost(&self, change: &ModelChange) -> Option<ground::Expression> {
        let ModelChange::Update {
            operator,
            fluent,
            value,
        } = change
        else {
            return None;
        };
        self.metric.as_ref()?.cost(*fluent, *operator, value)
    }
}
