//! Fluents whose continuous changes affect one action at a time, such as the battery of a robot
//! that drives, works or charges.
//!
//! Each action that reads or changes such a fluent needs a fact at its start and deletes it (the
//! robot is idle), and only the ends of these actions add it again. So no two of them run at the
//! same time, and nothing uses the fluent between start and end of an action. A continuous change
//! then counts as a change at the end: the over-all condition and the condition of the end depend
//! on the value at the start and the duration.

use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::reads::{visit_fluents, visit_tests};
use super::symbols::Symbols;
use super::{Action, Change, NONE, Rule, Snap, Timed};
use crate::embedded::formula::{Linear, Literal, Numeric, Test};

/// The parts of the compiled problem that determine exclusive fluents.
#[derive(Clone, Copy)]
pub(super) struct Parts<'a> {
    pub(super) actions: &'a [Action],
    pub(super) snaps: &'a [Snap],
    pub(super) timed: &'a [Timed],
    pub(super) strata: &'a [Vec<Rule>],
    pub(super) symbols: &'a Symbols,
    /// For each fact, whether it holds in the situation.
    pub(super) holds: &'a [bool],
}

impl Parts<'_> {
    /// Returns for each fluent `true` if no two actions that read or change it run at the same
    /// time, and nothing else changes it. The goal may still read it.
    pub(super) fn exclusive_fluents(self) -> Vec<bool> {
        let count = self.symbols.fluents.len();
        // For each fluent, the facts that all its visited actions delete; `None` before the first
        // action.
        let mut taken: Vec<Option<Vec<u32>>> = vec![None; count];
        let mut used = Vec::new();
        let tests = &self.symbols.tests;
        for action in self.actions {
            used.clear();
            visit_fluents(action, self.snaps, tests, &mut |fluent| used.push(fluent));
            used.sort_unstable();
            used.dedup();
            for &fluent in &used {
                match &mut taken[fluent as usize] {
                    Some(facts) => facts.retain(|&fact| self.occupies(action, fact)),
                    place => *place = Some(self.facts_of(action)),
                }
            }
        }
        for timed in self.timed {
            for (fluent, _) in &timed.assigns {
                taken[*fluent as usize] = None;
            }
        }
        for rule in self.strata.iter().flatten() {
            visit_tests(&rule.body, tests, &mut |fluent| {
                taken[fluent as usize] = None;
            });
        }
        let mut is_lock: Vec<Option<bool>> = vec![None; self.symbols.facts.len()];
        let mut exclusive = Vec::with_capacity(count);
        for facts in taken {
            exclusive.push(
                facts
                    .into_iter()
                    .flatten()
                    .any(|fact| *is_lock[fact as usize].get_or_insert_with(|| self.is_lock(fact))),
            );
        }
        exclusive
    }

    /// Returns the facts that the action may occupy.
    fn facts_of(self, action: &Action) -> Vec<u32> {
        let facts: Vec<u32> = match self.snaps.get(action.start as usize) {
            Some(start) => start.condition.literals.iter().map(|l| l.fact()).collect(),
            None => self.snaps[action.end as usize].adds.clone(),
        };
        let occupied = facts.into_iter();
        occupied
            .filter(|&fact| self.occupies(action, fact))
            .collect()
    }

    /// Returns `true` if the action needs the fact and makes it false while it runs. For an action
    /// that started before the situation, only the end is known.
    fn occupies(self, action: &Action, fact: u32) -> bool {
        let Some(start) = self.snaps.get(action.start as usize) else {
            return self.snaps[action.end as usize].adds.contains(&fact);
        };
        let is_needed = start.condition.literals.contains(&Literal::new(fact, true));
        let is_taken = start.deletes.contains(&fact) && !start.adds.contains(&fact);
        is_needed && (action.end == NONE || is_taken)
    }

    /// Returns `true` if at most one action that occupies the fact runs at a time: the fact and the
    /// running actions that occupy it form a mutex group.
    fn is_lock(self, fact: u32) -> bool {
        let adds = |snap: &Snap| {
            let mut conditional = snap.conditional.iter();
            snap.adds.contains(&fact)
                || conditional
                    .any(|effect| matches!(effect.change, Change::Add(own) if own == fact))
        };
        let is_derived = self.strata.iter().flatten().any(|rule| rule.head == fact);
        let is_timed = self.timed.iter().any(|timed| timed.adds.contains(&fact));
        let mut holders = usize::from(self.holds[fact as usize]);
        let gives_back = |action: &Action| {
            let start = self.snaps.get(action.start as usize);
            let end = self.snaps.get(action.end as usize);
            let is_added = start.is_some_and(adds);
            !is_added && (!end.is_some_and(adds) || self.occupies(action, fact))
        };
        let running = self.actions.iter().filter(|action| action.start == NONE);
        holders += running
            .filter(|action| adds(&self.snaps[action.end as usize]))
            .count();
        !is_derived && !is_timed && holders <= 1 && self.actions.iter().all(gives_back)
    }
}

/// Returns tests at the start of an action that its continuous changes of exclusive fluents imply:
/// the value at its end is the one at its start plus at least the change in the least duration.
pub(super) fn implied_tests(
    action: &Action,
    exclusive: &[bool],
    snaps: &[Snap],
    tests: &[Test],
) -> Vec<(Comparison, Linear)> {
    let (Some(start), Some(end)) = (
        snaps.get(action.start as usize),
        snaps.get(action.end as usize),
    ) else {
        return Vec::new();
    };
    let later = action.over_all.tests.iter().chain(&end.condition.tests);
    later
        .filter_map(|&test| {
            let test = &tests[test as usize];
            let Numeric::Linear(difference) = &test.difference else {
                return None;
            };
            let [(fluent, coefficient)] = &difference.terms[..] else {
                return None;
            };
            if !exclusive[*fluent as usize] || !difference.duration.is_zero() {
                return None;
            }
            let jumps =
                |effect: &Change| matches!(effect, Change::Update(own) if own.fluent == *fluent);
            let mut conditional = start.conditional.iter();
            if start.updates.iter().any(|own| own.fluent == *fluent)
                || conditional.any(|effect| jumps(&effect.change))
            {
                return None;
            }
            let slope = coefficient * &rate(action, *fluent)?;
            // At the open end of the interval, a strict test need not hold.
            let comparison = match test.comparison {
                Comparison::AtLeast | Comparison::Greater if slope.is_negative() => {
                    Comparison::AtLeast
                }
                Comparison::AtMost | Comparison::Less if slope.is_positive() => Comparison::AtMost,
                _ => return None,
            };
            let mut sum = difference.clone();
            sum.constant += &slope * &action.duration.least;
            Some((comparison, sum))
        })
        .collect()
}

/// Returns the rate at which the action changes the fluent, if it is certain.
fn rate(action: &Action, fluent: u32) -> Option<Rational> {
    let mut flows = action.flows.iter().filter(|flow| flow.fluent == fluent);
    flows.try_fold(Rational::ZERO, |sum, flow| {
        let rate = flow.rate.as_constant().filter(|_| flow.guard.is_none())?;
        Some(sum + rate)
    })
}
