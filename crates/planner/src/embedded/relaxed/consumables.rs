//! What is used up and never filled up.
//!
//! Nothing is ever lost in a relaxed plan, so one litre fills every bottle, and a battery that
//! cannot be charged takes a robot everywhere. Here the steps of a relaxed plan draw on what there
//! is: a step that is to be repeated until a number is reached is repeated as often as its
//! consumable allows, and other steps that add to that number do the rest. What is missing then is
//! no proof, since another relaxed plan might make do with less; but such a state has its turn
//! last.

use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::super::compile::{Change, Compiled, NONE};
use super::super::state::State;
use super::changes::changes_by;
use super::graph::{Gain, Graph, Kind};
use super::resources::note_floors;

/// Something that steps use up and nothing fills up.
#[derive(Clone, Debug)]
pub(crate) struct Consumable {
    fluent: u32,
    /// The amount that must remain.
    floor: f64,
    /// The amount at the beginning, above the floor.
    size: f64,
}

impl Consumable {
    fn left(&self, state: &State) -> f64 {
        let value = state.values[self.fluent as usize].as_ref();
        value.map_or(self.size, |value| value.to_f64() - self.floor)
    }

    /// Which part of it a state has used up.
    pub(crate) fn used(&self, state: &State) -> f64 {
        1.0 - self.left(state) / self.size
    }
}

/// Fluents that constants use up, that are tested, and that nothing fills up.
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
    let initial = &compiled.beginning.values;
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
    /// For each operator what it takes; an end takes what its start takes, and the start nothing.
    draws: Vec<Vec<(usize, f64)>>,
    /// For each test the operators that add to its difference, and how much.
    adders: Vec<Vec<(u32, f64)>>,
    /// The amount of each that a relaxed plan leaves.
    left: Vec<f64>,
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
            left: Vec::with_capacity(list.len()),
            list,
            draws,
            adders,
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// A new relaxed plan begins.
    pub(super) fn begin(&mut self, state: &State) {
        self.left.clear();
        self.left
            .extend(self.list.iter().map(|consumable| consumable.left(state)));
    }

    /// How often an operator can take what it takes, at most so many times.
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
            let times = ((self.left[place] + 1e-9) / amount).floor().clamp(0.0, 1e6) as u32;
            most.min(times)
        })
    }

    /// The operator takes what it takes, so many times.
    pub(super) fn draw(&mut self, operator: u32, times: u32) {
        if self.list.is_empty() {
            return;
        }
        for &(place, amount) in &self.draws[operator as usize] {
            self.left[place] -= amount * f64::from(times);
        }
    }

    /// Whether something takes what is not there.
    pub(super) fn are_overdrawn(&self) -> bool {
        self.left.iter().any(|&left| left < -1e-9)
    }

    /// The operators that add to the difference of a test.
    pub(super) fn adders(&self, test: u32) -> &[(u32, f64)] {
        &self.adders[test as usize]
    }
}
