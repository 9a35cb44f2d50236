//! Facts and values that no reached action and no timed initial writes.

use elbowroom_num::Rational;

use crate::ground::{FactId, FluentId};
use crate::simplify::Constants;
use crate::table::Table;

use super::relaxation::Relaxation;
use super::value::Value;

/// Cached results, by position of the fact or fluent.
#[derive(Default)]
pub(super) struct ResultCache {
    facts: Vec<Known<bool>>,
    fluents: Vec<Known<Rational>>,
}

#[derive(Clone, Default)]
enum Known<T> {
    #[default]
    NotComputed,
    Varies,
    Always(T),
}

/// The facts and fluents of a task that no reached event writes.
///
/// A fact that is only added where it is already true counts as written: the action that adds it
/// may not do so at the moment when it is read.
pub(super) struct UnwrittenSymbols<'u> {
    pub(super) table: &'u Table,
    pub(super) relaxation: &'u Relaxation<'u>,
    pub(super) cache: &'u mut ResultCache,
}

impl Constants for UnwrittenSymbols<'_> {
    fn truth(&mut self, fact: FactId) -> Option<bool> {
        cached(&mut self.cache.facts, fact.index(), || {
            let (predicate, arguments) = self.table.atom(fact);
            // A derived fact changes with those that its rules mention.
            if self.relaxation.problem.predicates[predicate.index()].is_derived {
                return None;
            }
            self.relaxation.reached.constant(*predicate, arguments)
        })
    }

    fn value(&mut self, fluent: FluentId) -> Option<Rational> {
        cached(&mut self.cache.fluents, fluent.index(), || {
            let (function, arguments) = self.table.application(fluent);
            match self.relaxation.constant(*function, arguments) {
                Value::Number(value) => Some(value),
                Value::Varies | Value::Undefined => None,
            }
        })
    }
}

fn cached<T: Clone>(
    memory: &mut Vec<Known<T>>,
    position: usize,
    find: impl FnOnce() -> Option<T>,
) -> Option<T> {
    if memory.len() <= position {
        memory.resize(position + 1, Known::NotComputed);
    }
    if let Known::NotComputed = memory[position] {
        memory[position] = find().map_or(Known::Varies, Known::Always);
    }
    match &memory[position] {
        Known::Always(value) => Some(value.clone()),
        Known::Varies | Known::NotComputed => None,
    }
}
