//! What can come about: a fact becomes true, a fact becomes false, a number changes.

use std::hash::Hash;

use indexmap::Equivalent;

use crate::problem::{FunctionId, ObjectId, PredicateId};

/// A kind of event, arguments aside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) enum Symbol {
    /// A fact of the predicate is true at some time.
    True(PredicateId),
    /// A fact of the predicate is deleted, whether or not it was true.
    False(PredicateId),
    /// A fluent of the function is given a value.
    Changed(FunctionId),
}

/// A kind of event with its arguments.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Event {
    /// What happens.
    pub(super) symbol: Symbol,
    /// To which fact or fluent.
    pub(super) arguments: Box<[ObjectId]>,
}

/// An [`Event`] to look up, without a box of its own.
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
