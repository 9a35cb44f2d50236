//! Queue of conclusions that are not possible yet, indexed by the events that they wait for.

use std::ops::ControlFlow;

use crate::problem::{ObjectId, SchemaId};

use super::effects::EffectId;
use super::event::Event;
use crate::hash::{Map, Set};

/// All waiting entries, each with a ticket.
pub(super) struct WatchLists {
    /// `None` if the entry has left the queue.
    entries: Vec<Option<Entry>>,
    /// Entries to retry for each event.
    watchers: Map<Event, Vec<EntryId>>,
    /// Number of further entries that may wait.
    remaining_capacity: usize,
}

/// Position in the queue.
#[derive(Clone, Copy, Debug)]
pub(super) struct EntryId(usize);

/// A conclusion that is not possible yet.
#[derive(Clone, Debug)]
pub(super) enum Pending {
    /// A binding of a rule (by position) whose tests are not all possible.
    Binding(usize, Box<[ObjectId]>),
    /// An instance (by position) that has started and cannot end yet.
    End(SchemaId, usize),
    /// An effect whose guard is not possible yet, with the objects of all its variables.
    Effect(EffectId, Box<[ObjectId]>),
}

struct Entry {
    conclusion: Pending,
    /// Events that retry it, if there are several. Some of them may have been reached.
    watched: Set<Event>,
}

impl WatchLists {
    pub(super) fn new(room: usize) -> Self {
        Self {
            entries: Vec::new(),
            watchers: Map::default(),
            remaining_capacity: room,
        }
    }

    /// Queues an entry until one of the events is reached. Breaks if the queue is full. An entry
    /// without events can never become possible and is dropped.
    pub(super) fn enqueue(&mut self, what: Pending, events: Vec<Event>) -> ControlFlow<()> {
        if events.is_empty() {
            return ControlFlow::Continue(());
        }
        if self.remaining_capacity == 0 {
            return ControlFlow::Break(());
        }
        self.remaining_capacity -= 1;
        let ticket = EntryId(self.entries.len());
        self.entries.push(Some(Entry {
            conclusion: what,
            watched: Set::default(),
        }));
        self.watch(ticket, events);
        ControlFlow::Continue(())
    }

    /// Returns the entries that wait for the event, and removes the event.
    pub(super) fn wake(&mut self, event: &Event) -> Vec<EntryId> {
        self.watchers.swap_remove(event).unwrap_or_default()
    }

    /// Returns the waiting entry with this ticket, unless it has left the queue.
    pub(super) fn get(&self, ticket: EntryId) -> Option<&Pending> {
        Some(&self.entries[ticket.0].as_ref()?.conclusion)
    }

    /// Queues a retried entry again until one of the events is reached, or removes it if there are
    /// none.
    pub(super) fn requeue(&mut self, ticket: EntryId, events: Vec<Event>) {
        if events.is_empty() {
            self.entries[ticket.0] = None;
            self.remaining_capacity += 1;
        } else {
            self.watch(ticket, events);
        }
    }

    fn watch(&mut self, ticket: EntryId, events: Vec<Event>) {
        let Some(entry) = &mut self.entries[ticket.0] else {
            return;
        };
        // An entry that waits for a single event, the usual case, needs no set of watched events.
        let is_only = events.len() == 1 && entry.watched.is_empty();
        for event in events {
            if is_only || entry.watched.insert(event.clone()) {
                self.watchers.entry(event).or_default().push(ticket);
            }
        }
    }
}
