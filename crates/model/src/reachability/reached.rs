//! The events reached so far, in order, with the true facts indexed by each of their arguments.

use crate::problem::{FunctionId, ObjectId, PredicateId};

use super::event::{Event, EventKey, Symbol};
use crate::hash::Set;

/// All events that can come about, in the order in which they were found.
///
/// The first ones are the facts that are true at time 0. The position of an event is its age:
/// the fixpoint walks through them in this order, and a join for one event looks at no later one.
#[derive(Debug)]
pub(super) struct Reached {
    events: Set<Event>,
    relations: Vec<Relation>,
    initial: usize,
    /// For each initial fact, whether something adds it (again).
    added_again: Vec<bool>,
}

/// The true facts of one predicate, as positions in [`Reached::events`], ascending.
#[derive(Clone, Debug, Default)]
struct Relation {
    all: Vec<u32>,
    /// By argument position, then by object.
    by_argument: Vec<Vec<Vec<u32>>>,
}

impl Reached {
    /// At time 0.
    pub(super) fn initially<'a>(
        predicate_count: usize,
        facts: impl Iterator<Item = (PredicateId, &'a [ObjectId])>,
    ) -> Self {
        let mut reached = Self {
            events: Set::default(),
            relations: vec![Relation::default(); predicate_count],
            initial: 0,
            added_again: Vec::new(),
        };
        for (predicate, arguments) in facts {
            reached.insert(Symbol::True(predicate), arguments);
        }
        reached.initial = reached.events.len();
        reached.added_again = vec![false; reached.initial];
        reached
    }

    /// Notes that the event can come about.
    pub(super) fn insert(&mut self, symbol: Symbol, arguments: &[ObjectId]) {
        let key = EventKey { symbol, arguments };
        if let Some(position) = self.events.get_index_of(&key) {
            if let Some(again) = self.added_again.get_mut(position) {
                *again = true;
            }
            return;
        }
        let (position, _) = self.events.insert_full(key.to_event());
        if let Symbol::True(predicate) = symbol {
            let position = u32::try_from(position).expect("fewer than 2^32 events");
            self.relations[predicate.index()].insert(position, arguments);
        }
    }

    /// The event at that position, if there are so many.
    pub(super) fn get(&self, position: usize) -> Option<&Event> {
        self.events.get_index(position)
    }

    /// The facts that are true at some time, in the order in which they were found.
    pub(super) fn facts(&self) -> impl Iterator<Item = (PredicateId, &[ObjectId])> {
        self.events.iter().filter_map(|event| match event.symbol {
            Symbol::True(predicate) => Some((predicate, &*event.arguments)),
            Symbol::False(_) | Symbol::Changed(_) => None,
        })
    }

    /// Where the fact stands, if it is true at some time.
    pub(super) fn position(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<usize> {
        self.events.get_index_of(&EventKey {
            symbol: Symbol::True(predicate),
            arguments,
        })
    }

    /// Whether the fact is true at some time.
    pub(super) fn is_ever_true(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        self.position(predicate, arguments).is_some()
    }

    /// Whether the basic fact is false at some time.
    pub(super) fn is_ever_false(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        let is_initial = self
            .position(predicate, arguments)
            .is_some_and(|position| position < self.initial);
        !is_initial || self.is_deleted(predicate, arguments)
    }

    /// Whether the fluent is given a value after time 0.
    pub(super) fn is_changed(&self, function: FunctionId, arguments: &[ObjectId]) -> bool {
        self.events.contains(&EventKey {
            symbol: Symbol::Changed(function),
            arguments,
        })
    }

    /// The truth of a basic fact that nothing adds or deletes, not even to no effect.
    pub(super) fn constant(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<bool> {
        if self.is_deleted(predicate, arguments) {
            return None;
        }
        match self.position(predicate, arguments) {
            None => Some(false),
            Some(position) if self.added_again.get(position) == Some(&false) => Some(true),
            Some(_) => None,
        }
    }

    fn is_deleted(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        self.events.contains(&EventKey {
            symbol: Symbol::False(predicate),
            arguments,
        })
    }

    /// The true facts of the predicate.
    pub(super) fn all(&self, predicate: PredicateId) -> &[u32] {
        &self.relations[predicate.index()].all
    }

    /// The true facts of the predicate with `object` as the argument at `position`.
    pub(super) fn with_argument(
        &self,
        predicate: PredicateId,
        position: usize,
        object: ObjectId,
    ) -> &[u32] {
        self.relations[predicate.index()]
            .by_argument
            .get(position)
            .and_then(|by_object| by_object.get(object.index()))
            .map_or(&[], Vec::as_slice)
    }

    /// The arguments of the event at that position.
    pub(super) fn arguments(&self, position: u32) -> &[ObjectId] {
        &self.events[position as usize].arguments
    }
}

impl Relation {
    fn insert(&mut self, event: u32, arguments: &[ObjectId]) {
        self.all.push(event);
        self.by_argument.resize(arguments.len(), Vec::new());
        for (by_object, object) in self.by_argument.iter_mut().zip(arguments) {
            if by_object.len() <= object.index() {
                by_object.resize(object.index() + 1, Vec::new());
            }
            by_object[object.index()].push(event);
        }
    }
}
