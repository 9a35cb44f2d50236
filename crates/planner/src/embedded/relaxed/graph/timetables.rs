//! Literals that change at fixed times only, and the windows that they leave.

use std::ops::Range;

use super::super::super::compile::{Change, Compiled, NONE, Timed};
use super::super::super::formula::{Formula, Literal};
use super::super::super::time::{NEVER, Ticks};
use super::actions::{Draft, least_ticks, most_ticks};
use super::{Graph, Kind, narrow};

/// A literal that changes at fixed times only, and an operator needs.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Position in [`Graph::timetable`].
    pub(crate) timetable: u32,
    /// The operator must begin at least so long after the literal has become true …
    pub(crate) lead: Ticks,
    /// … and at least so long before it becomes false.
    pub(crate) tail: Ticks,
}

impl Graph {
    /// Whether the literal changes at fixed times only.
    pub(crate) fn has_timetable(&self, literal: Literal) -> bool {
        self.timetable_of[literal.index()] != NONE
    }

    /// Takes the literal of a timetable to be true at all times; returns when it was.
    pub(crate) fn forget_timetable(&mut self, number: usize) -> Vec<(Ticks, Ticks)> {
        std::mem::replace(&mut self.timetable[number], vec![(-NEVER, NEVER)])
    }

    /// The literal of a timetable.
    pub(crate) fn timetable_literal(&self, number: usize) -> Option<Literal> {
        let number = narrow(number);
        let place = self
            .timetable_of
            .iter()
            .position(|&entry| entry == number)?;
        Some(Literal(narrow(place)))
    }

    /// When the literal holds, if it changes at fixed times only.
    pub(crate) fn spans_of(&self, literal: Literal) -> Option<&[(Ticks, Ticks)]> {
        let number = self.timetable_of[literal.index()];
        let spans = self.timetable.get(number as usize)?;
        Some(spans)
    }

    /// Finds the literals that only timed initials change.
    pub(super) fn add_timetables(&mut self, compiled: &Compiled) {
        self.timetable_of = vec![NONE; 2 * compiled.facts.len()];
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
            if !compiled.timed.iter().any(|timed| touches(&timed)) {
                continue;
            }
            for literal in [Literal::new(fact, true), Literal::new(fact, false)] {
                let mut spans = Vec::new();
                let holds = compiled.beginning.facts[fact as usize] == literal.truth();
                let mut since = holds.then_some(-NEVER);
                for timed in compiled.timed.iter().filter(touches) {
                    let is_true = timed.adds.contains(&fact);
                    match (since, is_true == literal.truth()) {
                        (None, true) => since = Some(timed.time),
                        (Some(begin), false) => {
                            spans.push((begin, timed.time));
                            since = None;
                        }
                        _ => {}
                    }
                }
                spans.extend(since.map(|begin| (begin, NEVER)));
                self.timetable_of[literal.index()] = narrow(self.timetable.len());
                self.timetable.push(spans);
            }
        }
    }

    /// The windows in which the operator can begin.
    pub(super) fn windows_of(&mut self, compiled: &Compiled, draft: &Draft<'_>) -> Range<usize> {
        let begin = self.windows.len();
        if self.timetable.is_empty() {
            return begin..begin;
        }
        let epsilon = compiled.epsilon;
        let least = least_ticks(compiled, draft.action);
        let most = most_ticks(compiled, draft.action);
        let mut add = |formula: &Formula, lead: Ticks, tail: Ticks| {
            for literal in &formula.literals {
                let timetable = self.timetable_of[literal.index()];
                if timetable != NONE {
                    self.windows.push(Window {
                        timetable,
                        lead,
                        tail,
                    });
                }
            }
        };
        add(&draft.snaps[0].condition, epsilon, epsilon);
        if !matches!(draft.kind, Kind::End(_)) {
            add(&draft.action.over_all, 0, least);
            if draft.action.end != NONE {
                let end = &compiled.snap(draft.action.end).condition;
                add(end, (epsilon - most).max(-NEVER), least + epsilon);
            }
        }
        begin..self.windows.len()
    }
}
