//! Envelopes: facts that hold only while some action runs, and the actions for which they hold long
//! enough.
//!
//! If every action that adds a fact deletes it at its own end, that action is an *envelope* of all
//! actions with the fact as over-all condition (Cushing et al., "When is temporal planning really
//! temporal?", IJCAI 2007; Coles et al., AAAI 2008). An action longer than the maximum duration of
//! the envelope does not fit into it, although the fact is true when it starts. So in the relaxed
//! problem, such an action requires the fact for a minimum time, not just the fact.

use std::collections::BTreeMap;

use super::super::super::compile::{Action, Change, Compiled, NONE};
use super::super::super::end_windows::EndWindows;
use super::super::super::formula::Literal;
use super::super::super::state::State;
use super::super::super::time::{NEVER, Ticks};
use super::actions::{least_ticks, most_ticks};

/// A fact that holds for at least some time.
#[derive(Clone, Debug)]
pub(crate) struct Stay {
    pub(crate) proposition: u32,
    fact: u32,
    least: Ticks,
    /// The actions during which the fact holds.
    envelopes: Vec<u32>,
}

impl Stay {
    /// Returns `true` if the fact holds, and no running action must delete it too soon.
    pub(crate) fn holds(&self, state: &State, spans: Option<&EndWindows>) -> bool {
        if !Literal::new(self.fact, true).holds(&state.facts) {
            return false;
        }
        state.open.iter().enumerate().all(|(place, open)| {
            if !self.envelopes.contains(&open.action) || open.most >= NEVER {
                return true;
            }
            match spans {
                Some(spans) => spans.ends[place].1 - spans.now >= self.least,
                None => open.most >= self.least,
            }
        })
    }
}

/// The stays that some action needs.
#[derive(Clone, Debug, Default)]
pub(super) struct Stays {
    pub(super) list: Vec<Stay>,
    by_need: BTreeMap<(u32, Ticks), u32>,
}

impl Stays {
    /// Computes the stays; `first` is the number of the first proposition.
    pub(super) fn of(compiled: &Compiled, first: u32) -> Self {
        let envelopes = envelopes(compiled);
        let mut stays = Self::default();
        let mut next = first;
        for action in compiled
            .actions
            .iter()
            .filter(|a| a.start != NONE && a.end != NONE)
        {
            let least = least_ticks(compiled, action);
            for fact in lasting(compiled, action) {
                let Some(envelopes) = &envelopes[fact as usize] else {
                    continue;
                };
                let is_short =
                    |&number: &u32| most_ticks(compiled, compiled.action(number)) < least;
                if !envelopes.iter().any(is_short) || stays.by_need.contains_key(&(fact, least)) {
                    continue;
                }
                stays.by_need.insert((fact, least), next);
                stays.list.push(Stay {
                    proposition: next,
                    fact,
                    least,
                    envelopes: envelopes.clone(),
                });
                next += 1;
            }
        }
        stays
    }

    /// Returns the stays that an action needs, in addition to its preconditions.
    pub(super) fn needs<'a>(
        &'a self,
        compiled: &'a Compiled,
        action: &'a Action,
    ) -> impl Iterator<Item = u32> + 'a {
        let least = least_ticks(compiled, action);
        let facts = lasting(compiled, action);
        facts.filter_map(move |fact| self.by_need.get(&(fact, least)).copied())
    }

    /// Returns the stays that an action's start adds, in addition to its effects.
    pub(super) fn offers<'a>(
        &'a self,
        compiled: &Compiled,
        number: u32,
    ) -> impl Iterator<Item = u32> + 'a {
        let most = most_ticks(compiled, compiled.action(number));
        let fits = move |stay: &&Stay| most >= stay.least && stay.envelopes.contains(&number);
        self.list.iter().filter(fits).map(|stay| stay.proposition)
    }
}

/// Returns the facts of an action's over-all condition that its start does not add.
fn lasting<'a>(compiled: &'a Compiled, action: &'a Action) -> impl Iterator<Item = u32> + 'a {
    let own = &compiled.snap(action.start).adds;
    let literals = action.over_all.literals.iter().filter(|l| l.truth());
    let facts = literals.map(|literal| literal.fact());
    facts.filter(move |fact| !own.contains(fact))
}

/// Returns for each fact the actions during which it holds, if no other happening makes it true.
fn envelopes(compiled: &Compiled) -> Vec<Option<Vec<u32>>> {
    let mut envelopes: Vec<Option<Vec<u32>>> = vec![Some(Vec::new()); compiled.facts.len()];
    let timed = compiled.timed.iter().flat_map(|timed| &timed.adds);
    let derived = compiled.derived.iter().flatten();
    for &fact in timed.chain(derived) {
        envelopes[fact as usize] = None;
    }
    for (number, action) in (0..).zip(&compiled.actions) {
        let end = (action.end != NONE).then(|| compiled.snap(action.end));
        if action.start != NONE {
            for &fact in &compiled.snap(action.start).adds {
                if !end.is_some_and(|end| end.deletes.contains(&fact)) {
                    envelopes[fact as usize] = None;
                }
            }
        }
        // Running actions were started before.
        for &fact in end.iter().flat_map(|end| &end.deletes) {
            if let Some(envelopes) = &mut envelopes[fact as usize] {
                envelopes.push(number);
            }
        }
        for &fact in end.iter().flat_map(|end| &end.adds) {
            envelopes[fact as usize] = None;
        }
        for snap in [action.start, action.end]
            .into_iter()
            .filter(|&snap| snap != NONE)
        {
            for effect in &compiled.snap(snap).conditional {
                if let Change::Add(fact) | Change::Delete(fact) = effect.change {
                    envelopes[fact as usize] = None;
                }
            }
        }
    }
    envelopes
}
