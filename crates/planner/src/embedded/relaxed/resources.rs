//! What a relaxed plan uses up.
//!
//! Nothing is ever lost in a relaxed plan, not even what its steps consume: one charge of a battery
//! takes a robot everywhere. So what the steps of a relaxed plan use up is counted, and where that
//! is more than there is, steps that fill it up are added. (The balance of producers and consumers
//! is LPRPG's idea; Coles, Fox, Long & Smith, ICAPS 2008. Here no linear program is solved, only
//! the sum over one relaxed plan is looked at.)

use elbowroom_model::problem::{Comparison, UpdateOperator};

use super::super::compile::{Action, Compiled, NONE, Snap};
use super::super::formula::{Formula, Numeric};
use super::super::state::State;
use super::graph::{Graph, Kind};

/// A fluent that some steps use up, and must not run out of.
#[derive(Clone, Debug)]
struct Resource {
    fluent: u32,
    /// The amount that must remain.
    floor: f64,
    /// The operators that fill it up, and by how much.
    feeds: Vec<(u32, f64)>,
}

/// A shortage of a resource in a relaxed plan.
#[derive(Clone, Copy, Debug)]
pub(super) struct Shortage {
    /// An operator that fills it up.
    pub(super) operator: u32,
    /// How often it is needed, besides what the plan has.
    pub(super) times: u32,
}

/// The resources of a problem.
#[derive(Debug, Default)]
pub(super) struct Resources {
    list: Vec<Resource>,
    /// For each operator what it adds to resources, or, negative, takes.
    changes: Vec<Vec<(usize, f64)>>,
    /// The amount of each that a relaxed plan leaves.
    left: Vec<f64>,
    is_settled: Vec<bool>,
}

impl Resources {
    pub(super) fn of(compiled: &Compiled, graph: &Graph) -> Self {
        let mut resources = Self::default();
        let mut place = vec![None; compiled.fluents.len()];
        for (fluent, floor) in floors(compiled) {
            place[fluent as usize] = Some(resources.list.len());
            resources.list.push(Resource {
                fluent,
                floor,
                feeds: Vec::new(),
            });
        }
        if resources.list.is_empty() {
            return resources;
        }
        for (number, operator) in (0..).zip(&graph.operators) {
            let mut changes: Vec<(usize, f64)> = Vec::new();
            // An operator for a conditional effect has no other effects.
            let snaps = if operator.is_step {
                snaps_of(compiled, operator.kind)
            } else {
                Vec::new()
            };
            for (fluent, amount) in snaps.into_iter().flat_map(amounts) {
                let Some(place) = place[fluent as usize] else {
                    continue;
                };
                match changes.iter_mut().find(|change| change.0 == place) {
                    Some(change) => change.1 += amount,
                    None => changes.push((place, amount)),
                }
            }
            for &(place, amount) in changes.iter().filter(|change| change.1 > 0.0) {
                resources.list[place].feeds.push((number, amount));
            }
            resources.changes.push(changes);
        }
        resources
    }

    /// Whether nothing is used up.
    pub(super) fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// A new relaxed plan begins.
    pub(super) fn begin(&mut self, state: &State) {
        self.left.clear();
        self.is_settled.clear();
        for resource in &self.list {
            let value = state.values[resource.fluent as usize].as_ref();
            self.left
                .push(value.map_or(f64::INFINITY, |value| value.to_f64() - resource.floor));
            self.is_settled.push(false);
        }
    }

    /// The relaxed plan has an operator, so many times.
    pub(super) fn note(&mut self, operator: u32, times: u32) {
        for &(place, amount) in &self.changes[operator as usize] {
            self.left[place] += amount * f64::from(times);
        }
    }

    /// What to add for the sake of a resource that runs out; each resource is told once. `cost`
    /// says what an operator costs that is within reach.
    pub(super) fn shortage(&mut self, cost: impl Fn(u32) -> Option<u32>) -> Option<Shortage> {
        for (place, resource) in self.list.iter().enumerate() {
            if self.left[place] >= 0.0 || self.is_settled[place] {
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
            let times = (-self.left[place] / amount).ceil().clamp(1.0, 1000.0) as u32;
            return Some(Shortage { operator, times });
        }
        None
    }
}

pub(super) fn snaps_of(compiled: &Compiled, kind: Kind) -> Vec<&Snap> {
    let numbers = match kind {
        Kind::Start(action) => vec![compiled.action(action).start],
        Kind::End(action) => vec![compiled.action(action).end],
        Kind::Compressed(action) => {
            let action = compiled.action(action);
            vec![action.start, action.end]
        }
        Kind::Timed(_) | Kind::Axiom => Vec::new(),
    };
    numbers.into_iter().map(|n| compiled.snap(n)).collect()
}

/// The constants that a happening adds to fluents.
pub(super) fn amounts(snap: &Snap) -> impl Iterator<Item = (u32, f64)> + '_ {
    snap.updates.iter().filter_map(|update| {
        let amount = update.value.as_constant()?.to_f64();
        match update.operator {
            UpdateOperator::Increase => Some((update.fluent, amount)),
            UpdateOperator::Decrease => Some((update.fluent, -amount)),
            _ => None,
        }
    })
}

/// The fluents that are used up and filled up, with what has to be left of them.
pub(crate) fn floors(compiled: &Compiled) -> Vec<(u32, f64)> {
    let mut floors: Vec<Option<f64>> = vec![None; compiled.fluents.len()];
    for action in &compiled.actions {
        note_floors(compiled, action, &mut floors);
    }
    let mut is_filled_up = vec![false; compiled.fluents.len()];
    for (fluent, _) in compiled
        .snaps
        .iter()
        .flat_map(amounts)
        .filter(|c| c.1 > 0.0)
    {
        is_filled_up[fluent as usize] = true;
    }
    let floors = (0..).zip(floors).zip(is_filled_up);
    floors
        .filter(|&(_, is_filled_up)| is_filled_up)
        .filter_map(|((fluent, floor), _)| Some((fluent, floor?)))
        .collect()
}

/// Notes what has to be left of the fluents that the action uses up: the least that some action
/// leaves.
pub(super) fn note_floors(compiled: &Compiled, action: &Action, floors: &mut [Option<f64>]) {
    for number in [action.start, action.end] {
        if number == NONE {
            continue;
        }
        let snap = compiled.snap(number);
        for (fluent, amount) in amounts(snap).filter(|change| change.1 < 0.0) {
            let before = least(compiled, &snap.condition, fluent).map(|least| least + amount);
            let after = least(compiled, &action.over_all, fluent);
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
}

/// The least value of a fluent that a condition asks for.
fn least(compiled: &Compiled, condition: &Formula, fluent: u32) -> Option<f64> {
    let bounds = condition.tests.iter().filter_map(|&test| {
        let test = &compiled.tests[test as usize];
        let Numeric::Linear(linear) = &test.difference else {
            return None;
        };
        let [(read, coefficient)] = &linear.terms[..] else {
            return None;
        };
        let is_lower = matches!(test.comparison, Comparison::AtLeast | Comparison::Greater);
        let applies = *read == fluent && is_lower && coefficient.is_positive();
        // What is more than a bound is a little more.
        let strictly = match test.comparison {
            Comparison::Greater => 1e-6,
            _ => 0.0,
        };
        applies.then(|| strictly - linear.constant.to_f64() / coefficient.to_f64())
    });
    bounds.max_by(f64::total_cmp)
}
