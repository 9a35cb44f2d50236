//! Selection of the timed initials that form calendars.

use std::collections::BTreeSet;

use elbowroom_model::Situation;
use elbowroom_model::ground::{Change, FactId};

use super::super::super::Calendar;
use super::super::super::calendars::{DatedFact, extract_conditions, nested_reads};
use super::super::super::interference::Access;
use super::super::Builder;
use super::FutureTimed;
use crate::embedded::formula::Formula;
use crate::embedded::time::Scale;
use crate::embedded::windows::Windows;

impl Builder<'_> {
    /// Removes the conditions on calendars from all happenings, and their timed initials from the
    /// future ones. `others` are the formulas that must not read a calendar. Also returns `true` if
    /// all times are on the grid.
    pub(super) fn extract_calendars<'f>(
        &mut self,
        coming: &mut FutureTimed,
        situation: &Situation,
        others: impl Iterator<Item = &'f Formula>,
        scale: Scale,
    ) -> (Vec<Calendar>, Windows, bool) {
        let facts = self.calendar_facts(coming, others);
        let mut are_exact = true;
        let mut dated: Vec<DatedFact> = Vec::new();
        for &fact in &facts {
            let Some(number) = self.symbols.known_fact(fact) else {
                continue;
            };
            let mut own = Vec::new();
            for happening in &coming.happenings {
                let is_added = happening.changes.contains(&Change::Add(fact));
                if is_added || happening.changes.contains(&Change::Delete(fact)) {
                    let (down, is_exact) = scale.floor(&happening.time);
                    are_exact &= is_exact;
                    own.push((down, scale.ceil(&happening.time).0, is_added));
                }
            }
            dated.push(DatedFact {
                fact: number,
                is_true_first: situation.state.facts.contains(&fact),
                changes: own,
            });
        }
        for happening in &mut coming.happenings {
            happening.changes.retain(|change| match change {
                Change::Add(fact) | Change::Delete(fact) => !facts.contains(fact),
                Change::Update { .. } => true,
            });
        }
        coming
            .happenings
            .retain(|happening| !happening.changes.is_empty());
        coming.separations = self.separations_of(&coming.happenings);
        let (calendars, windows) =
            extract_conditions(&dated, self.epsilon, &mut self.actions, &mut self.snaps);
        (calendars, windows, are_exact)
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
