//! Compression-safe actions: actions that may end before any other happening, in the order of
//! happenings, without losing plans.
//!
//! Consider a plan with happenings between the start and the end of an action. If none of them can
//! interact with the facts that the end adds, the end can directly follow the start in the order:
//! its time is the same, and so are all distances. A happening cannot interact with a fact if the
//! fact is false after the start and cannot become true without the end, and if every happening
//! that reads or deletes the fact needs it to be true. The search checks the first condition state
//! by state; this module decides the second.

use super::{Action, Change, NONE, Snap, Timed};
use crate::embedded::formula::{Formula, Literal};

/// The facts that matter only when true.
#[derive(Debug)]
pub(super) struct PositiveFacts {
    matters_only_true: Vec<bool>,
}

impl PositiveFacts {
    pub(super) fn of(
        actions: &[Action],
        snaps: &[Snap],
        timed: &[Timed],
        fact_count: usize,
    ) -> Self {
        let mut ends = Self {
            matters_only_true: vec![true; fact_count],
        };
        for &fact in timed.iter().flat_map(|timed| &timed.deletes) {
            ends.matters_only_true[fact as usize] = false;
        }
        for action in actions {
            ends.note_formula(&action.over_all);
            action
                .guards
                .iter()
                .for_each(|guard| ends.note_formula(guard));
            for number in [action.start, action.end] {
                let Some(snap) = snaps.get(number as usize) else {
                    continue;
                };
                ends.note_formula(&snap.condition);
                for effect in &snap.conditional {
                    // The truth of the condition decides whether the effect deletes, or reads.
                    effect
                        .now
                        .visit_literals(&mut |literal| ends.exclude(literal));
                    if let Change::Delete(fact) | Change::Add(fact) = effect.change {
                        ends.matters_only_true[fact as usize] = false;
                    }
                }
                for &fact in &snap.deletes {
                    let needed = Literal::new(fact, true);
                    let is_needed = snap.condition.literals.contains(&needed)
                        || number == action.end && action.over_all.literals.contains(&needed);
                    if !is_needed {
                        ends.matters_only_true[fact as usize] = false;
                    }
                }
            }
        }
        ends
    }

    fn note_formula(&mut self, formula: &Formula) {
        for &literal in &formula.literals {
            if !literal.truth() {
                self.exclude(literal);
            }
        }
        for part in formula.choices.iter().flatten() {
            part.visit_literals(&mut |literal| self.exclude(literal));
        }
    }

    fn exclude(&mut self, literal: Literal) {
        self.matters_only_true[literal.fact() as usize] = false;
    }

    /// Returns `true` if the end of the action only adds such facts.
    pub(super) fn only_adds_positive_facts(&self, action: &Action, snaps: &[Snap]) -> bool {
        if action.start == NONE || action.end == NONE {
            return false;
        }
        let end = &snaps[action.end as usize];
        let over_all = &action.over_all;
        let mut reads_numbers = false;
        if let Some(cost) = &end.cost {
            cost.visit_fluents(&mut |_| reads_numbers = true);
        }
        end.condition.is_trivial()
            && !reads_numbers
            && end.deletes.is_empty()
            && end.updates.is_empty()
            && end.conditional.is_empty()
            && action.flows.is_empty()
            && !action.duration.bounds.iter().any(|bound| bound.at_end)
            && over_all.tests.is_empty()
            && over_all.choices.is_empty()
            && end
                .adds
                .iter()
                .all(|&fact| self.matters_only_true[fact as usize])
    }
}
