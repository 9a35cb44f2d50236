//! Resources that a relaxed plan uses up.
//!
//! In a relaxed plan nothing is ever lost, not even the resources that its steps consume: one
//! charge of a battery takes a robot everywhere. So the consumption of a relaxed plan is summed up,
//! and if it exceeds the available amount, steps that replenish the resource are added. (The
//! balance of producers and consumers is LPRPG's idea; Coles, Fox, Long & Smith, ICAPS 2008. No
//! linear program is solved here; only the sum over one relaxed plan is considered.)

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::super::compile::{Action, Compiled};
use super::super::formula::{Formula, Numeric};
use super::super::state::State;
use super::super::symbolic;
use super::super::tuning::Technique;
use super::changes::{assignments, changes, changes_by};
use super::graph::{Graph, Kind};

/// The capacity of a reservoir without a bound.
const UNBOUNDED: f64 = 1e12;

/// A fluent that some steps use up, and that has a lower bound.
#[derive(Clone, Debug)]
struct Resource {
    reservoir: Reservoir,
    /// The operators that replenish it, and the amounts.
    feeds: Vec<(u32, f64)>,
}

impl Resource {
    /// Returns the capacity.
    fn size(&self) -> f64 {
        (self.reservoir.ceiling - self.reservoir.floor).clamp(0.0, UNBOUNDED)
    }
}

/// A shortage of a resource in a relaxed plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shortage {
    /// An operator that replenishes it.
    pub(super) operator: u32,
    /// Number of times it is needed, in addition to those in the plan.
    pub(super) times: u32,
    /// `true` if the state has little or no capacity left for it, so that it is useful only later.
    pub(super) is_later: bool,
}

/// The resources of a problem.
#[derive(Debug, Default)]
pub(super) struct Resources {
    list: Vec<Resource>,
    /// For each operator, the amounts that it adds to resources; negative for consumption.
    changes: Vec<Vec<(usize, f64)>>,
    /// The amount of each in the state, minus its floor.
    levels: Vec<f64>,
    /// The remaining amount of each after a relaxed plan.
    remaining: Vec<f64>,
    is_settled: Vec<bool>,
}

impl Resources {
    pub(super) fn of(compiled: &Compiled, graph: &Graph) -> Self {
        let mut resources = Self::default();
        let mut place = vec![None; compiled.fluents.len()];
        for reservoir in reservoirs(compiled) {
            place[reservoir.fluent as usize] = Some(resources.list.len());
            resources.list.push(Resource {
                reservoir,
                feeds: Vec::new(),
            });
        }
        if resources.list.is_empty() {
            return resources;
        }
        for (number, operator) in (0..).zip(&graph.operators) {
            let mut changes: Vec<(usize, f64)> = Vec::new();
            // An operator for a conditional effect has no other effects.
            let own = operator
                .is_step
                .then(|| changes_by(compiled, operator.kind));
            for (fluent, amount) in own.into_iter().flatten() {
                let Some(place) = place[fluent as usize] else {
                    continue;
                };
                match changes.iter_mut().find(|change| change.0 == place) {
                    Some(change) => change.1 += amount,
                    None => changes.push((place, amount)),
                }
            }
            let assignments = operator
                .is_step
                .then(|| assignments(compiled, operator.kind));
            for (fluent, value) in assignments.into_iter().flatten() {
                let Some(place) = place[fluent as usize] else {
                    continue;
                };
                let amount = value - resources.list[place].reservoir.floor;
                if amount > 0.0 && changes.iter().all(|change| change.0 != place) {
                    changes.push((place, amount));
                }
            }
            for (place, amount) in &mut changes {
                *amount = amount.min(resources.list[*place].size());
            }
            for &(place, amount) in changes.iter().filter(|change| change.1 > 0.0) {
                resources.list[place].feeds.push((number, amount));
            }
            resources.changes.push(changes);
        }
        resources
    }

    /// Returns `true` if there are no resources.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Begins a new relaxed plan. The continuous changes of running actions count as complete.
    pub(super) fn reset(&mut self, compiled: &Compiled, state: &State) {
        self.levels.clear();
        self.is_settled.clear();
        for Resource { reservoir, .. } in &self.list {
            let level = match &state.values[reservoir.fluent as usize] {
                Some(value) => value.to_f64(),
                None if compiled.tuning.uses(Technique::ContinuousDrains) => {
                    let highest = symbolic::highest_level(compiled, state, reservoir.fluent);
                    let highest = highest.map_or(f64::INFINITY, |level| level.to_f64());
                    highest.min(reservoir.ceiling)
                }
                None => f64::INFINITY,
            };
            self.levels.push(level - reservoir.floor);
            self.is_settled.push(false);
        }
        self.remaining.clone_from(&self.levels);
    }

    /// Records that the relaxed plan contains an operator `times` times.
    pub(super) fn note(&mut self, operator: u32, times: u32) {
        for &(place, amount) in &self.changes[operator as usize] {
            self.remaining[place] += amount * f64::from(times);
        }
    }

    /// Returns `true` if a resource runs out that was not reported.
    pub(super) fn is_short(&self) -> bool {
        let mut resources = self.remaining.iter().zip(&self.is_settled);
        resources.any(|(&remaining, &is_settled)| remaining < 0.0 && !is_settled)
    }

    /// Returns an operator that replenishes a resource which runs out. Each resource is reported
    /// once. `cost` returns the cost of a reachable operator.
    pub(super) fn shortage(&mut self, cost: impl Fn(u32) -> Option<u32>) -> Option<Shortage> {
        for (place, resource) in self.list.iter().enumerate() {
            if self.remaining[place] >= 0.0 || self.is_settled[place] {
                continue;
            }
            self.is_settled[place] = true;
            let within_reach = resource.feeds.iter().filter_map(|&(operator, amount)| {
                let cost = cost(operator)?;
                Some((cost, operator, amount))
            });
            let Some((_, operator, amount)) = within_reach.min_by_key(|&(c, o, _)| (c, o)) else {
                continue;
            };
            #[allow(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "clamped to a small positive range"
            )]
            let times = (-self.remaining[place] / amount).ceil().clamp(1.0, 1000.0) as u32;
            let room = resource.size() - self.levels[place];
            return Some(Shortage {
                operator,
                times,
                is_later: room < amount.min(resource.size() / 2.0),
            });
        }
        None
    }
}

/// A fluent that is used up and replenished.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reservoir {
    pub(crate) fluent: u32,
    /// The amount that must remain.
    pub(crate) floor: f64,
    /// The highest value at the beginning or after an action that replenishes it; infinite if it
    /// has no bound.
    pub(crate) ceiling: f64,
}

/// Returns the fluents that are used up and replenished.
pub(crate) fn reservoirs(compiled: &Compiled) -> Vec<Reservoir> {
    let mut floors: Vec<Option<f64>> = vec![None; compiled.fluents.len()];
    let mut ceilings: Vec<Option<f64>> = vec![None; compiled.fluents.len()];
    for action in &compiled.actions {
        note_floors(compiled, action, &mut floors);
        note_ceilings(compiled, action, &mut ceilings);
    }
    for number in 0..compiled.actions.len() {
        let number = u32::try_from(number).expect("fewer than 2^32 actions");
        for (fluent, value) in assignments(compiled, Kind::Compressed(number)) {
            if floors[fluent as usize].is_some_and(|floor| value > floor) {
                let known = &mut ceilings[fluent as usize];
                *known = Some(known.map_or(value, |known| known.max(value)));
            }
        }
    }
    let bounds = (0..).zip(floors.into_iter().zip(ceilings));
    let reservoirs = bounds.filter_map(|(fluent, (floor, ceiling))| {
        let initial = compiled.initial.values[fluent as usize].as_ref();
        let initial = initial.map_or(f64::INFINITY, Rational::to_f64);
        Some(Reservoir {
            fluent,
            floor: floor?,
            ceiling: ceiling?.max(initial),
        })
    });
    reservoirs.collect()
}

/// Records the minimum remaining values of the fluents that the action uses up: the least value
/// that some action leaves.
pub(super) fn note_floors(compiled: &Compiled, action: &Action, floors: &mut [Option<f64>]) {
    for change in changes(compiled, action).filter(|change| change.amount < 0.0) {
        let (fluent, amount) = (change.fluent, change.amount);
        let mut before = change.before(compiled, action);
        let before = before.find_map(|before| least(compiled, before, (fluent, amount)));
        let after = least(compiled, &action.over_all, (fluent, 0.0));
        let floor = match (before, after) {
            (Some(before), Some(after)) => Some(before.max(after)),
            (before, after) => before.or(after),
        };
        if let Some(floor) = floor {
            let known = &mut floors[fluent as usize];
            *known = Some(known.map_or(floor, |known| known.min(floor)));
        }
    }
}

/// Records the highest values of the fluents that the action replenishes.
fn note_ceilings(compiled: &Compiled, action: &Action, ceilings: &mut [Option<f64>]) {
    for change in changes(compiled, action).filter(|change| change.amount > 0.0) {
        let (fluent, amount) = (change.fluent, change.amount);
        let mut before = change.before(compiled, action);
        let bounds = [
            before.find_map(|before| most(compiled, before, (fluent, amount))),
            most(compiled, &action.over_all, (fluent, 0.0)),
        ];
        let ceiling = bounds.into_iter().flatten().fold(f64::INFINITY, f64::min);
        let known = &mut ceilings[fluent as usize];
        *known = Some(known.map_or(ceiling, |known| known.max(ceiling)));
    }
}

/// Returns the least value of a fluent after a change, by a condition before it.
fn least(compiled: &Compiled, condition: &Formula, change: (u32, f64)) -> Option<f64> {
    bounds(compiled, condition, change, true).max_by(f64::total_cmp)
}

/// Returns the highest value of a fluent after a change, by a condition before it.
fn most(compiled: &Compiled, condition: &Formula, change: (u32, f64)) -> Option<f64> {
    bounds(compiled, condition, change, false).min_by(f64::total_cmp)
}

/// Returns the lower or the upper bounds on a fluent after a change, by the conjuncts of a
/// condition before it. A conjunct that also reads `?duration` is assumed to include the change
/// already.
fn bounds(
    compiled: &Compiled,
    condition: &Formula,
    (fluent, amount): (u32, f64),
    are_lower: bool,
) -> impl Iterator<Item = f64> {
    condition.tests.iter().filter_map(move |&test| {
        let test = &compiled.tests[test as usize];
        let Numeric::Linear(linear) = &test.difference else {
            return None;
        };
        let [(read, coefficient)] = &linear.terms[..] else {
            return None;
        };
        let (is_at_least, is_strict) = match test.comparison {
            Comparison::AtLeast => (true, false),
            Comparison::Greater => (true, true),
            Comparison::AtMost => (false, false),
            Comparison::Less => (false, true),
            Comparison::Equal => return None,
        };
        let is_lower = is_at_least == coefficient.is_positive();
        // A strict bound is approximated by a small margin.
        let strictly = match (is_strict, is_lower) {
            (false, _) => 0.0,
            (true, true) => 1e-6,
            (true, false) => -1e-6,
        };
        let bound = strictly - linear.constant.to_f64() / coefficient.to_f64();
        let amount = if linear.duration.is_zero() {
            amount
        } else {
            0.0
        };
        (*read == fluent && is_lower == are_lower).then_some(bound + amount)
    })
}
