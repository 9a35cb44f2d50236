//! Literals and tests that change at fixed times only, and the resulting windows.

use std::ops::Range;

use super::super::super::compile::{Change, Compiled, Dates, NONE, Snap, Timed, spans};
use super::super::super::formula::{Formula, Literal};
use super::super::super::time::{NEVER, Ticks};
use super::actions::{Draft, least_ticks, most_ticks};
use super::{Graph, Kind, narrow};

/// A literal or test that changes at fixed times only and that an operator needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Position in [`Graph::timetable`].
    pub(crate) timetable: u32,
    /// The minimum time from the literal becoming true to the beginning of the operator.
    pub(crate) lead: Ticks,
    /// The minimum time from the beginning of the operator to the literal becoming false.
    pub(crate) tail: Ticks,
}

impl Graph {
    /// Returns `true` if the literal changes at fixed times only.
    pub(crate) fn has_timetable(&self, literal: Literal) -> bool {
        self.timetable_of[literal.index()] != NONE
    }

    /// Assumes that the literal of a timetable is always true. Returns the intervals in which it
    /// holds.
    pub(crate) fn forget_timetable(&mut self, number: usize) -> Vec<(Ticks, Ticks)> {
        std::mem::replace(&mut self.timetable[number], vec![(-NEVER, NEVER)])
    }

    /// Returns the literal of a timetable, or `None` if it is that of a test.
    pub(crate) fn timetable_literal(&self, number: usize) -> Option<Literal> {
        let number = narrow(number);
        let place = self
            .timetable_of
            .iter()
            .position(|&entry| entry == number)?;
        Some(Literal(narrow(place)))
    }

    /// Returns the intervals in which the literal holds, if it changes at fixed times only.
    pub(crate) fn spans_of(&self, literal: Literal) -> Option<&[(Ticks, Ticks)]> {
        let number = self.timetable_of[literal.index()];
        let spans = self.timetable.get(number as usize)?;
        Some(spans)
    }

    /// Finds the literals that only timed initials change.
    pub(super) fn add_timetables(&mut self, compiled: &Compiled) {
        self.timetable_of = vec![NONE; 2 * compiled.facts.len()];
        // The timetables of calendars have the numbers of the calendars.
        for calendar in &compiled.calendars {
            self.add_timetable(calendar.literal, calendar.spans.clone());
        }
        if compiled.timed.is_empty() {
            return;
        }
        let mut is_changed = vec![false; compiled.facts.len()];
        for snap in &compiled.snaps {
            for &fact in snap.adds.iter().chain(&snap.deletes) {
                is_changed[fact as usize] = true;
            }
            for effect in &snap.conditional {
                if let Change::Add(fact) | Change::Delete(fact) = effect.change {
                    is_changed[fact as usize] = true;
                }
            }
        }
        for &fact in compiled.derived.iter().flatten() {
            is_changed[fact as usize] = true;
        }
        for fact in (0..narrow(compiled.facts.len())).filter(|&f| !is_changed[f as usize]) {
            let touches =
                |timed: &&Timed| timed.adds.contains(&fact) || timed.deletes.contains(&fact);
            let changes: Vec<(Ticks, Ticks, bool)> = compiled
                .timed
                .iter()
                .filter(touches)
                .map(|timed| (timed.time, timed.time, timed.adds.contains(&fact)))
                .collect();
            if changes.is_empty() {
                continue;
            }
            for truth in [true, false] {
                let holds = compiled.initial.facts[fact as usize] == truth;
                let spans = spans(holds, truth, &changes);
                self.add_timetable(Some(Literal::new(fact, truth)), spans);
            }
        }
    }

    fn add_timetable(&mut self, literal: Option<Literal>, spans: Vec<(Ticks, Ticks)>) {
        if let Some(literal) = literal {
            self.timetable_of[literal.index()] = narrow(self.timetable.len());
        }
        self.timetable.push(spans);
    }

    /// Adds the windows in which the operator can begin, and returns their range.
    pub(super) fn windows_of(&mut self, compiled: &Compiled, draft: &Draft<'_>) -> Range<usize> {
        let begin = self.windows.len();
        if self.timetable.is_empty() {
            return begin..begin;
        }
        let epsilon = compiled.epsilon;
        let least = least_ticks(compiled, draft.action);
        let most = most_ticks(compiled, draft.action);
        let mut add = |(formula, dates): (&Formula, &Dates), lead: Ticks, tail: Ticks| {
            let literals = formula.literals.iter();
            let timetables = literals.map(|literal| self.timetable_of[literal.index()]);
            for timetable in timetables.chain(dates.calendars.iter().copied()) {
                if timetable != NONE {
                    self.windows.push(Window {
                        timetable,
                        lead,
                        tail,
                    });
                }
            }
        };
        add(read_by(draft.snaps[0]), epsilon, epsilon);
        if !matches!(draft.kind, Kind::End(_)) {
            let action = draft.action;
            add((&action.over_all, &action.dates), 0, least);
            if action.end != NONE {
                let end = read_by(compiled.snap(action.end));
                add(end, (epsilon - most).max(-NEVER), least + epsilon);
            }
        }
        begin..self.windows.len()
    }
}

/// Returns the conditions of a happening.
fn read_by(snap: &Snap) -> (&Formula, &Dates) {
    (&snap.condition, &snap.dates)
}
