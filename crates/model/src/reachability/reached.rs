//! The events reached so far, in order, with the true facts indexed by each of their arguments.

use crate::problem::{FunctionId, ObjectId, PredicateId};

use super::event::{Event, EventKey, Symbol};
use crate::hash::Set;

/// All reachable events, in the order of discovery.
///
/// The first ones are the facts that are true at time 0. The position of an event is its age: the
/// fixpoint processes them in this order, and a join for one event uses no later events.
#[derive(Debug)]
pub(super) struct Reached {
    events: Set<Event>,
    relations: Vec<Relation>,
    initial: usize,
    /// For each initial fact, `true` if an effect adds it.
    is_added_by_effect: Vec<bool>,
}

/// The true facts of one predicate, as positions in [`Reached::events`], ascending.
#[derive(Clone, Debug, Default)]
struct Relation {
    all: Vec<u32>,
    /// Positions by argument position, then by object.
    by_argument: Vec<Vec<Vec<u32>>>,
}

impl Reached {
    /// Creates the set of facts that are true at time 0.
    pub(super) fn at_time_zero<'a>(
        predicate_count: usize,
        facts: impl Iterator<Item = (PredicateId, &'a [ObjectId])>,
    ) -> Self {
        let mut reached = Self {
            events: Set::default(),
            relations: vec![Relation::default(); predicate_count],
            initial: 0,
            is_added_by_effect: Vec::new(),
        };
        for (predicate, arguments) in facts {
            reached.insert(Symbol::True(predicate), arguments);
        }
        reached.initial = reached.events.len();
        reached.is_added_by_effect = vec![false; reached.initial];
        reached
    }

    /// Records a reachable event.
    pub(super) fn insert(&mut self, symbol: Symbol, arguments: &[ObjectId]) {
        let key = EventKey { symbol, arguments };
        if let Some(position) = self.events.get_index_of(&key) {
            if let Some(again) = self.is_added_by_effect.get_mut(position) {
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

    /// Returns the event at that position, if it exists.
    pub(super) fn get(&self, position: usize) -> Option<&Event> {
        self.events.get_index(position)
    }

    /// Returns the facts that are true at some time, in the order of discovery.
    pub(super) fn facts(&self) -> impl Iterator<Item = (PredicateId, &[ObjectId])> {
        self.events.iter().filter_map(|event| match event.symbol {
            Symbol::True(predicate) => Some((predicate, &*event.arguments)),
            Symbol::False(_) | Symbol::Changed(_) => None,
        })
    }

    /// Returns the position of the fact, if it is true at some time.
    pub(super) fn position(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<usize> {
        self.events.get_index_of(&EventKey {
            symbol: Symbol::True(predicate),
            arguments,
        })
    }

    /// Returns `true` if the fact is true at some time.
    pub(super) fn is_ever_true(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        self.position(predicate, arguments).is_some()
    }

    /// Returns `true` if the basic fact is false at some time.
    pub(super) fn is_ever_false(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        let is_initial = self
            .position(predicate, arguments)
            .is_some_and(|position| position < self.initial);
        !is_initial || self.is_deleted(predicate, arguments)
    }

    /// Returns `true` if the fluent is given a value after time 0.
    pub(super) fn is_changed(&self, function: FunctionId, arguments: &[ObjectId]) -> bool {
        self.events.contains(&EventKey {
            symbol: Symbol::Changed(function),
            arguments,
        })
    }

    /// Returns the truth value of a basic fact that no effect adds or deletes, even redundantly.
    pub(super) fn constant(&self, predicate: PredicateId, arguments: &[ObjectId]) -> Option<bool> {
        if self.is_deleted(predicate, arguments) {
            return None;
        }
        match self.position(predicate, arguments) {
            None => Some(false),
            Some(position) if self.is_added_by_effect.get(position) == Some(&false) => Some(true),
            Some(_) => None,
        }
    }

    fn is_deleted(&self, predicate: PredicateId, arguments: &[ObjectId]) -> bool {
        self.events.contains(&EventKey {
            symbol: Symbol::False(predicate),
            arguments,
        })
    }

    /// Returns the true facts of the predicate.
    pub(super) fn all(&self, predicate: PredicateId) -> &[u32] {
        &self.relations[predicate.index()].all
    }

    /// Returns the true facts of the predicate with `object` as the argument at `position`.
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

    /// Returns the arguments of the event at that position.
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
