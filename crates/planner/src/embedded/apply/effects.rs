//! Effects of happenings.

use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::compile::{Change, Snap, Update, is_conflict};
use super::super::expressions::Moment;
use super::super::formula::{Numeric, set};
use super::super::state::State;
use super::super::symbolic;
use super::Stepper;
use super::conditions::Side;

impl Stepper<'_> {
    /// Applies the effects. All of them read the state before the happening.
    pub(super) fn take_effect(
        &mut self,
        state: &mut State,
        snap: &Snap,
        guards: u64,
        duration: Option<&Rational>,
        moment: &Moment,
    ) -> Option<()> {
        let (mut adds, mut deletes) = (Vec::new(), Vec::new());
        let mut updates: Vec<&Update> = snap.updates.iter().collect();
        let mut costs: Vec<&Numeric> = snap.cost.iter().collect();
        for effect in &snap.conditional {
            let was_chosen = effect
                .at_start
                .is_none_or(|guard| guards >> guard.min(63) & 1 == 1);
            if was_chosen && self.require(state, &effect.now, duration).is_some() {
                match &effect.change {
                    Change::Add(fact) => adds.push(*fact),
                    Change::Delete(fact) => deletes.push(*fact),
                    Change::Update(update) => updates.push(update),
                    Change::Cost(cost) => costs.push(cost),
                }
            }
        }
        if is_conflict(&updates) {
            return None;
        }
        for cost in costs {
            // The duration of an action that was running in the situation may be open. Its cost is
            // not counted here, but the validator counts it.
            if let Some(cost) = cost.value(&state.values, duration) {
                state.cost += cost;
            }
        }
        if state.symbolic.is_some() {
            self.update_symbolic(state, &updates, moment)?;
        } else {
            update_values(state, &updates, duration)?;
        }
        for &fact in snap.deletes.iter().chain(&deletes) {
            set(&mut state.facts, fact, false);
        }
        for &fact in snap.adds.iter().chain(&adds) {
            set(&mut state.facts, fact, true);
        }
        if !self.compiled.strata.is_empty() {
            state.derive(self.compiled);
        }
        Some(())
    }

    fn update_symbolic(
        &mut self,
        state: &mut State,
        updates: &[&Update],
        moment: &Moment,
    ) -> Option<()> {
        if updates.is_empty() {
            return Some(());
        }
        let fluents: Vec<u32> = updates.iter().map(|update| update.fluent).collect();
        self.recheck_over_all(state, &fluents, (Side::Arrival, moment))?;
        let read: Option<Vec<_>> = updates
            .iter()
            .map(|update| symbolic::read(state, update, moment))
            .collect();
        for (fluent, operator, amount) in read? {
            symbolic::update(state, fluent, operator, &amount, moment)?;
        }
        self.recheck_over_all(state, &fluents, (Side::After, moment))
    }
}

/// Applies numeric effects. All of them read the state before the happening.
fn update_values(
    state: &mut State,
    updates: &[&Update],
    duration: Option<&Rational>,
) -> Option<()> {
    if updates.is_empty() {
        return Some(());
    }
    let amounts: Option<Vec<Rational>> = updates
        .iter()
        .map(|update| update.value.value(&state.values, duration))
        .collect();
    for (update, amount) in updates.iter().zip(amounts?) {
        let place = &mut state.values[update.fluent as usize];
        *place = Some(match (update.operator, place.take()) {
            (UpdateOperator::Assign, _) => amount,
            (_, None) => return None,
            (UpdateOperator::Increase, Some(old)) => old + amount,
            (UpdateOperator::Decrease, Some(old)) => old - amount,
            (UpdateOperator::ScaleUp, Some(old)) => old * amount,
            (UpdateOperator::ScaleDown, Some(old)) => old.checked_div(&amount)?,
        });
    }
    Some(())
}
