//! Consumables: numbers that are used up and never replenished.
//!
//! In a relaxed plan nothing is ever lost, so one litre fills every bottle, and a battery that
//! cannot be charged takes a robot everywhere. Here the steps of a relaxed plan draw on the
//! available amounts. A step that must be repeated to reach a number is repeated as often as its
//! consumable allows, and other steps that add to that number do the rest. A shortage proves
//! nothing, since another relaxed plan might need less, but such states are expanded last.

use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::compile::{Change, Compiled, NONE};
use super::super::state::State;
use super::changes::changes_by;
use super::graph::{Gain, Graph, Kind};
use super::resources::note_floors;

/// A fluent that steps use up and that is never replenished.
#[derive(Clone, Debug)]
pub(crate) struct Consumable {
    fluent: u32,
    /// The amount that must remain.
    floor: f64,
    /// The initial amount above the floor.
    size: f64,
}

impl Consumable {
    fn remaining(&self, state: &State) -> f64 {
        let value = state.values[self.fluent as usize].as_ref();
        value.map_or(self.size, |value| value.to_f64() - self.floor)
    }

    /// Returns the fraction that a state has used up.
    pub(crate) fn used(&self, state: &State) -> f64 {
        1.0 - self.remaining(state) / self.size
    }
}

/// Returns the fluents that constants use up, that are tested, and that are never replenished.
pub(crate) fn consumables(compiled: &Compiled) -> Vec<Consumable> {
    let mut floors: Vec<Option<f64>> = vec![None; compiled.fluents.len()];
    for action in &compiled.actions {
        note_floors(compiled, action, &mut floors);
    }
    for snap in &compiled.snaps {
        for update in &snap.updates {
            let amount = update.value.as_constant();
            let is_negative = amount.is_some_and(Rational::is_negative);
            let only_takes = amount.is_some()
                && match update.operator {
                    UpdateOperator::Decrease => !is_negative,
                    UpdateOperator::Increase => is_negative,
                    _ => false,
                };
            if !only_takes {
                floors[update.fluent as usize] = None;
            }
        }
        for effect in &snap.conditional {
            if let Change::Update(update) = &effect.change {
                floors[update.fluent as usize] = None;
            }
        }
    }
    let timed = compiled.timed.iter().flat_map(|timed| &timed.assigns);
    for (fluent, _) in timed {
        floors[*fluent as usize] = None;
    }
    for flow in compiled.actions.iter().flat_map(|action| &action.flows) {
        floors[flow.fluent as usize] = None;
    }
    let initial = &compiled.initial.values;
    let consumables = (0..).zip(floors).filter_map(|(fluent, floor)| {
        let floor = floor?;
        let size = initial[fluent as usize].as_ref()?.to_f64() - floor;
        (size > 0.0).then_some(Consumable {
            fluent,
            floor,
            size,
        })
    });
    consumables.collect()
}

/// The consumable resources that the steps of a relaxed plan use.
#[derive(Debug, Default)]
pub(super) struct Consumables {
    list: Vec<Consumable>,
    /// For each operator, its consumption. An end consumes the amount of its start as well, and the
    /// start nothing.
    draws: Vec<Vec<(usize, f64)>>,
    /// For each test, the operators that add to its difference, and the amounts.
    adders: Vec<Vec<(u32, f64)>>,
    /// The remaining amount of each after a relaxed plan.
    remaining: Vec<f64>,
}

impl Consumables {
    pub(super) fn of(compiled: &Compiled, graph: &Graph) -> Self {
        let list = consumables(compiled);
        if list.is_empty() {
            return Self::default();
        }
        let draws = graph.operators.iter().map(|operator| {
            let mut draws: Vec<(usize, f64)> = Vec::new();
            let kinds = match operator.kind {
                Kind::Start(action) if compiled.action(action).end != NONE => return draws,
                Kind::End(action) if compiled.action(action).start != NONE => {
                    [Kind::Start(action), operator.kind]
                }
                kind => [Kind::Axiom, kind],
            };
            for kind in kinds.into_iter().filter(|_| operator.is_step) {
                for (fluent, amount) in changes_by(compiled, kind) {
                    if let Some(place) = list
                        .iter()
                        .position(|consumable| consumable.fluent == fluent)
                    {
                        draws.push((place, -amount));
                    }
                }
            }
            draws
        });
        let draws = draws.collect();
        let mut adders = vec![Vec::new(); compiled.tests.len()];
        for (number, operator) in (0..).zip(&graph.operators) {
            for &(test, gain) in &graph.gains[operator.gains.clone()] {
                if let Gain::Adds(gain) = gain {
                    adders[test as usize].push((number, gain));
                }
            }
        }
        Self {
            remaining: Vec::with_capacity(list.len()),
            list,
            draws,
            adders,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Begins a new relaxed plan.
    pub(super) fn reset(&mut self, state: &State) {
        self.remaining.clear();
        self.remaining.extend(
            self.list
                .iter()
                .map(|consumable| consumable.remaining(state)),
        );
    }

    /// Returns the number of times the remaining amounts suffice for an operator, at most `most`.
    pub(super) fn times(&self, operator: u32, most: u32) -> u32 {
        if self.list.is_empty() {
            return most;
        }
        let draws = &self.draws[operator as usize];
        draws.iter().fold(most, |most, &(place, amount)| {
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to a small positive range"
            )]
            let times = ((self.remaining[place] + 1e-9) / amount)
                .floor()
                .clamp(0.0, 1e6) as u32;
            most.min(times)
        })
    }

    /// Subtracts the consumption of an operator that is applied `times` times.
    pub(super) fn draw(&mut self, operator: u32, times: u32) {
        if self.list.is_empty() {
            return;
        }
        for &(place, amount) in &self.draws[operator as usize] {
            self.remaining[place] -= amount * f64::from(times);
        }
    }

    /// Returns `true` if some consumable is overdrawn.
    pub(super) fn are_overdrawn(&self) -> bool {
        self.remaining.iter().any(|&left| left < -1e-9)
    }

    /// Returns the operators that add to the difference of a test.
    pub(super) fn adders(&self, test: u32) -> &[(u32, f64)] {
        &self.adders[test as usize]
    }
}
