//! Macro-operators of an envelope and one content: the door is held open, the robot passes, and the
//! door is released, as one choice (macro-operators; Korf, Artificial Intelligence 26, 1985;
//! envelope and content: Halsey, Long & Fox, ICAPS workshop 2004).
//!
//! Starting an envelope alone does not reduce the distance to the goal. If many envelopes are
//! possible at any time, a search visits all sets of them.

use super::{Action, Compiled, Compressibility, NONE, Snap};
use crate::embedded::formula::{Formula, Literal};
use crate::embedded::hash::Map;

/// An envelope that runs only for one other action.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Macro {
    pub(crate) envelope: u32,
    pub(crate) content: u32,
}

impl Macro {
    /// Returns the macro-operators of a problem, by envelope and content.
    pub(crate) fn all(compiled: &Compiled) -> Vec<Self> {
        let envelopes = (0..).zip(&compiled.actions);
        let envelopes = envelopes.filter(|(_, action)| can_be_envelope(compiled, action));
        let envelopes: Vec<(u32, &Action)> = envelopes.collect();
        let offers = envelopes
            .iter()
            .map(|(_, action)| literals_while_running(compiled, action));
        let offers: Vec<Vec<Literal>> = offers.collect();
        if offers.iter().all(Vec::is_empty) {
            return Vec::new();
        }
        let mut contents: Map<Literal, Vec<u32>> = Map::default();
        contents.extend(offers.iter().flatten().map(|&offer| (offer, Vec::new())));
        for (number, action) in (0..).zip(&compiled.actions) {
            if can_be_content(compiled, action) {
                for literal in needs(compiled, action) {
                    contents.entry(literal).and_modify(|list| list.push(number));
                }
            }
        }
        let mut macros = Vec::new();
        for ((envelope, action), offers) in envelopes.into_iter().zip(&offers) {
            let contents = offers.iter().flat_map(|offer| &contents[offer]);
            let fitting = contents.filter(|&&content| {
                content != envelope && can_contain(compiled, action, compiled.action(content))
            });
            macros.extend(fitting.map(|&content| Self { envelope, content }));
        }
        macros.sort_unstable();
        macros.dedup();
        macros
    }
}

fn can_be_envelope(compiled: &Compiled, action: &Action) -> bool {
    action.start != NONE
        && action.end != NONE
        && action.compressibility == Compressibility::Envelope
        && action.flows.is_empty()
        && is_plain(compiled, action)
}

fn can_be_content(compiled: &Compiled, action: &Action) -> bool {
    let is_short = action.end == NONE || action.compressibility > Compressibility::Envelope;
    action.start != NONE && is_short && is_plain(compiled, action)
}

/// Returns `true` if the action has no conditional effects, and its end needs no literals that
/// other actions achieve.
fn is_plain(compiled: &Compiled, action: &Action) -> bool {
    let start = compiled.snap(action.start);
    if !start.conditional.is_empty() {
        return false;
    }
    if action.end == NONE {
        return true;
    }
    let end = compiled.snap(action.end);
    let Formula {
        literals,
        tests,
        choices,
    } = &end.condition;
    let over_all = &action.over_all;
    end.conditional.is_empty()
        && choices.is_empty()
        && tests.iter().all(|test| over_all.tests.contains(test))
        && literals
            .iter()
            .all(|literal| over_all.literals.contains(literal) || makes(start, *literal))
}

/// Returns the literals that hold while the action runs because it runs.
fn literals_while_running(compiled: &Compiled, action: &Action) -> Vec<Literal> {
    let (start, end) = (compiled.snap(action.start), compiled.snap(action.end));
    effects(start)
        .filter(|&literal| makes(end, opposite(literal)))
        .collect()
}

/// Returns the literals that the action needs.
fn needs<'a>(compiled: &'a Compiled, action: &'a Action) -> impl Iterator<Item = Literal> + 'a {
    let start = compiled.snap(action.start).condition.literals.iter();
    start.copied().chain(needs_throughout(compiled, action))
}

/// Returns the literals that the action needs while it runs, and does not achieve itself.
fn needs_throughout<'a>(
    compiled: &'a Compiled,
    action: &'a Action,
) -> impl Iterator<Item = Literal> + 'a {
    let start = compiled.snap(action.start);
    let literals = action.over_all.literals.iter().copied();
    literals.filter(move |&literal| !makes(start, literal))
}

/// Returns `true` if the content may run while the envelope runs.
fn can_contain(compiled: &Compiled, envelope: &Action, content: &Action) -> bool {
    let before = compiled.snap(envelope.start);
    let mut snaps = [content.start, content.end]
        .into_iter()
        .filter(|&snap| snap != NONE)
        .map(|snap| compiled.snap(snap));
    let mut held = envelope.over_all.literals.iter();
    let after = compiled.snap(envelope.end);
    let ends_within = needs_throughout(compiled, content).any(|need| makes(after, opposite(need)));
    let most = envelope.duration.most.as_ref().filter(|_| ends_within);
    most.is_none_or(|most| content.duration.least <= *most)
        && !needs(compiled, content).any(|need| makes(before, opposite(need)))
        && !held.any(|&literal| snaps.any(|snap| makes(snap, opposite(literal))))
}

fn effects(snap: &Snap) -> impl Iterator<Item = Literal> + '_ {
    let adds = snap.adds.iter().map(|&fact| Literal::new(fact, true));
    let deletes = snap.deletes.iter().map(|&fact| Literal::new(fact, false));
    adds.chain(deletes)
}

fn makes(snap: &Snap, literal: Literal) -> bool {
    let facts = if literal.truth() {
        &snap.adds
    } else {
        &snap.deletes
    };
    facts.contains(&literal.fact())
}

fn opposite(literal: Literal) -> Literal {
    Literal::new(literal.fact(), !literal.truth())
}
