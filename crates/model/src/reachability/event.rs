//! Events of the relaxation: a fact becomes true, a fact becomes false, a number changes.

use std::hash::Hash;

use indexmap::Equivalent;

use crate::problem::{FunctionId, ObjectId, PredicateId};

/// Kind of event, without arguments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Symbol {
    /// A fact of the predicate is true at some time.
    True(PredicateId),
    /// A fact of the predicate is deleted, whether or not it was true.
    False(PredicateId),
    /// A fluent of the function is given a value.
    Changed(FunctionId),
}

/// An event: its kind with arguments.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Event {
    /// The symbol of the event.
    pub(super) symbol: Symbol,
    /// Arguments of the fact or fluent.
    pub(super) arguments: Box<[ObjectId]>,
}

/// Key of an [`Event`] for look-ups, without an allocation.
#[derive(Clone, Copy, Debug, Hash)]
pub(super) struct EventKey<'a> {
    /// See [`Event::symbol`].
    pub(super) symbol: Symbol,
    /// See [`Event::arguments`].
    pub(super) arguments: &'a [ObjectId],
}

impl EventKey<'_> {
    pub(super) fn to_event(self) -> Event {
        Event {
            symbol: self.symbol,
            arguments: self.arguments.into(),
        }
    }
}

impl Equivalent<Event> for EventKey<'_> {
    fn equivalent(&self, event: &Event) -> bool {
        self.symbol == event.symbol && *self.arguments == *event.arguments
    }
}

/// A set of kinds of events.
#[derive(Clone, Debug, Default)]
pub(super) struct Symbols {
    /// Members of each kind (true, false, changed), by predicate or function.
    members: [Vec<bool>; 3],
}

impl Symbols {
    pub(super) fn insert(&mut self, symbol: Symbol) {
        let (kind, index) = Self::place(symbol);
        let members = &mut self.members[kind];
        if members.len() <= index {
            members.resize(index + 1, false);
        }
        members[index] = true;
    }

    pub(super) fn contains(&self, symbol: Symbol) -> bool {
        let (kind, index) = Self::place(symbol);
        self.members[kind].get(index) == Some(&true)
    }

    fn place(symbol: Symbol) -> (usize, usize) {
        match symbol {
            Symbol::True(predicate) => (0, predicate.index()),
            Symbol::False(predicate) => (1, predicate.index()),
            Symbol::Changed(function) => (2, function.index()),
        }
    }
}

impl Extend<Symbol> for Symbols {
    fn extend<I: IntoIterator<Item = Symbol>>(&mut self, symbols: I) {
        for symbol in symbols {
            self.insert(symbol);
        }
    }
}
