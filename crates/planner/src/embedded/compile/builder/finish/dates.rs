//! Selection of the timed initials that form calendars.

use std::collections::BTreeSet;

use elbowroom_model::Situation;
use elbowroom_model::ground::{Change, Expression, FactId, FluentId};
use elbowroom_num::Rational;

use super::super::super::calendars::{Dated, DatedCondition, extract_conditions, nested_reads};
use super::super::super::interference::Access;
use super::super::super::reads::{visit_fluents, visit_tests};
use super::super::super::{Calendar, Change as Effect};
use super::super::Builder;
use super::FutureTimed;
use crate::embedded::formula::Formula;
use crate::embedded::time::{Scale, Ticks};
use crate::embedded::windows::Windows;

/// A test that changes at fixed times only.
struct DatedTest {
    number: u32,
    /// The fluents that it reads.
    fluents: BTreeSet<u32>,
    is_true_first: bool,
    /// See [`DatedCondition::changes`].
    changes: Vec<(Ticks, Ticks, bool)>,
}

impl Builder<'_> {
    /// Removes the conditions on calendars from all happenings, and their timed initials from the
    /// future ones. `others` are the formulas that must not read a calendar. Also returns `true` if
    /// all times are on the grid.
    pub(super) fn extract_calendars(
        &mut self,
        coming: &mut FutureTimed,
        situation: &Situation,
        others: &[&Formula],
        scale: Scale,
    ) -> (Vec<Calendar>, Windows, bool) {
        let facts = self.calendar_facts(coming, others.iter().copied());
        let mut dated = self.dated_facts(&facts, coming, situation, scale);
        dated.extend(self.dated_tests(coming, situation, scale));
        let (calendars, windows) =
            extract_conditions(&dated, self.epsilon, &mut self.actions, &mut self.snaps);
        let fluents = self.calendar_fluents(coming, others);
        let mut are_exact = true;
        for happening in &mut coming.happenings {
            let count = happening.changes.len();
            happening.changes.retain(|change| match change {
                Change::Add(fact) | Change::Delete(fact) => !facts.contains(fact),
                Change::Update { fluent, .. } => !fluents.contains(fluent),
            });
            are_exact &=
                happening.changes.len() == count || scale.exactly(&happening.time).is_some();
        }
        coming
            .happenings
            .retain(|happening| !happening.changes.is_empty());
        coming.separations = self.separations_of(&coming.happenings);
        (calendars, windows, are_exact)
    }

    /// Returns the facts with their future changes.
    fn dated_facts(
        &self,
        facts: &BTreeSet<FactId>,
        coming: &FutureTimed,
        situation: &Situation,
        scale: Scale,
    ) -> Vec<DatedCondition> {
        let dated = facts.iter().filter_map(|&fact| {
            let changes = coming.happenings.iter().filter_map(|happening| {
                let is_added = happening.changes.contains(&Change::Add(fact));
                let is_changed = is_added || happening.changes.contains(&Change::Delete(fact));
                let (down, up) = (
                    scale.floor(&happening.time).0,
                    scale.ceil(&happening.time).0,
                );
                is_changed.then_some((down, up, is_added))
            });
            Some(DatedCondition {
                dated: Dated::Fact(self.symbols.known_fact(fact)?),
                is_true_first: situation.state.facts.contains(&fact),
                changes: changes.collect(),
            })
        });
        dated.collect()
    }

    /// Returns the tests on fluents that only timed initials change, with their future changes.
    fn dated_tests(
        &self,
        coming: &FutureTimed,
        situation: &Situation,
        scale: Scale,
    ) -> Vec<DatedCondition> {
        let mut tests = self.tests_on_timed_fluents(coming);
        if tests.is_empty() {
            return Vec::new();
        }
        let initial = &situation.state.values;
        let fluents = self.symbols.fluents.iter();
        let mut values: Vec<Option<Rational>> =
            fluents.map(|fluent| initial.get(fluent).cloned()).collect();
        let holds = |test: u32, values: &[Option<Rational>]| {
            let test = &self.symbols.tests[test as usize];
            let difference = test.difference.value(values, None);
            difference.is_some_and(|value| test.comparison.holds(&value, &Rational::ZERO))
        };
        for test in &mut tests {
            test.is_true_first = holds(test.number, &values);
        }
        for happening in &coming.happenings {
            let mut changed = BTreeSet::new();
            for change in &happening.changes {
                if let Change::Update { fluent, value, .. } = change
                    && let Some(number) = self.symbols.known_fluent(*fluent)
                    && let Expression::Constant(value) = value
                {
                    values[number as usize] = Some(value.clone());
                    changed.insert(number);
                }
            }
            let (down, up) = (
                scale.floor(&happening.time).0,
                scale.ceil(&happening.time).0,
            );
            for test in tests
                .iter_mut()
                .filter(|t| !t.fluents.is_disjoint(&changed))
            {
                test.changes.push((down, up, holds(test.number, &values)));
            }
        }
        let dated = tests.into_iter().map(|test| DatedCondition {
            dated: Dated::Test(test.number),
            is_true_first: test.is_true_first,
            changes: test.changes,
        });
        dated.collect()
    }

    /// Returns the tests that read a fluent that timed initials change, and none that actions
    /// change.
    fn tests_on_timed_fluents(&self, coming: &FutureTimed) -> Vec<DatedTest> {
        let (timed, written) = self.timed_fluents(coming);
        if timed.is_empty() {
            return Vec::new();
        }
        let tests = (0..).zip(&self.symbols.tests).filter_map(|(number, test)| {
            let mut fluents = BTreeSet::new();
            test.difference.visit_fluents(&mut |fluent| {
                fluents.insert(fluent);
            });
            let is_dated = !fluents.is_disjoint(&timed)
                && fluents.is_disjoint(&written)
                && !test.difference.reads_duration();
            is_dated.then_some(DatedTest {
                number,
                fluents,
                is_true_first: false,
                changes: Vec::new(),
            })
        });
        tests.collect()
    }

    /// Returns the fluents that timed initials change, and those that actions change.
    fn timed_fluents(&self, coming: &FutureTimed) -> (BTreeSet<u32>, BTreeSet<u32>) {
        let known = |fluent: &FluentId| self.symbols.known_fluent(*fluent);
        let mut written: BTreeSet<u32> = BTreeSet::new();
        for access in self.separations.iter().flat_map(|s| &s.makes) {
            if let Access::Raised(fluent) | Access::Lowered(fluent) | Access::Assigned(fluent) =
                access
            {
                written.extend(known(fluent));
            }
        }
        let flows = self.actions.iter().flat_map(|action| &action.flows);
        written.extend(flows.map(|flow| flow.fluent));
        for snap in &self.snaps {
            written.extend(snap.updates.iter().map(|update| update.fluent));
            written.extend(
                snap.conditional
                    .iter()
                    .filter_map(|effect| match &effect.change {
                        Effect::Update(update) => Some(update.fluent),
                        _ => None,
                    }),
            );
        }
        let mut timed = BTreeSet::new();
        for change in coming.happenings.iter().flat_map(|h| &h.changes) {
            if let Change::Update { fluent, value, .. } = change {
                match value {
                    Expression::Constant(_) => timed.extend(known(fluent)),
                    _ => written.extend(known(fluent)),
                }
            }
        }
        (timed, written)
    }

    /// Returns the fluents that only timed initials change, and that only conditions on calendars
    /// read. These conditions have been removed; `formulas` are those outside of actions.
    fn calendar_fluents(&self, coming: &FutureTimed, formulas: &[&Formula]) -> BTreeSet<FluentId> {
        let (mut fluents, written) = self.timed_fluents(coming);
        fluents.retain(|fluent| !written.contains(fluent));
        let mut visit = |fluent: u32| {
            fluents.remove(&fluent);
        };
        let tests = &self.symbols.tests;
        for formula in formulas {
            visit_tests(formula, tests, &mut visit);
        }
        for action in &self.actions {
            visit_fluents(action, &self.snaps, tests, &mut visit);
        }
        let numbers = fluents.into_iter();
        let mut fluents: BTreeSet<FluentId> = numbers
            .map(|fluent| self.symbols.fluents[fluent as usize])
            .collect();
        if let Some(metric) = &self.metric {
            metric.visit_fluents(&mut |fluent| {
                fluents.remove(&fluent);
            });
        }
        fluents
    }

    /// Returns the facts that only timed initials change, and that are read only as conjuncts of
    /// conditions of actions.
    fn calendar_facts<'f>(
        &self,
        coming: &FutureTimed,
        others: impl Iterator<Item = &'f Formula>,
    ) -> BTreeSet<FactId> {
        let nested = nested_reads(&self.actions, &self.snaps, others);
        let mut facts = BTreeSet::new();
        for change in coming.happenings.iter().flat_map(|h| &h.changes) {
            if let Change::Add(fact) | Change::Delete(fact) = change {
                facts.insert(*fact);
            }
        }
        for access in self.separations.iter().flat_map(|s| &s.makes) {
            if let Access::Added(fact) | Access::Deleted(fact) = access {
                facts.remove(fact);
            }
        }
        facts.retain(|&fact| {
            let number = self.symbols.known_fact(fact);
            number.is_some_and(|number| !nested.contains(&number))
        });
        facts
    }
}
