//! What is not possible yet, and the events that it waits for.

use std::ops::ControlFlow;

use crate::problem::{ObjectId, SchemaId};

use super::effects::EffectId;
use super::event::Event;
use crate::hash::{Map, Set};

/// Everything that waits, with a ticket each.
pub(super) struct WaitingRoom {
    /// `None` once it has come about.
    entries: Vec<Option<Entry>>,
    /// Whom an event wakes.
    watchers: Map<Event, Vec<Ticket>>,
    /// How many more may wait.
    room: usize,
}

/// A position in the waiting room.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ticket(usize);

/// A rule instance that is not applicable yet.
#[derive(Clone, Debug)]
pub(super) enum Pending {
    /// A binding of a rule (by position) whose tests are not all possible.
    Binding(usize, Box<[ObjectId]>),
    /// An instance (by position) that has started and cannot end.
    End(SchemaId, usize),
    /// An effect whose guard is not possible, with the objects of all its variables.
    Effect(EffectId, Box<[ObjectId]>),
}

struct Entry {
    what: Pending,
    /// The events that will wake it, if they are several. Some may have come about.
    watched: Set<Event>,
}

impl WaitingRoom {
    pub(super) fn new(room: usize) -> Self {
        Self {
            entries: Vec::new(),
            watchers: Map::default(),
            room,
        }
    }

    /// Lets it wait for one of the events; breaks if there is no room. What waits for nothing
    /// never comes about and is forgotten.
    pub(super) fn enter(&mut self, what: Pending, events: Vec<Event>) -> ControlFlow<()> {
        if events.is_empty() {
            return ControlFlow::Continue(());
        }
        if self.room == 0 {
            return ControlFlow::Break(());
        }
        self.room -= 1;
        let ticket = Ticket(self.entries.len());
        self.entries.push(Some(Entry {
            what,
            watched: Set::default(),
        }));
        self.watch(ticket, events);
        ControlFlow::Continue(())
    }

    /// Those that wait for the event; they wait for it no longer.
    pub(super) fn wake(&mut self, event: &Event) -> Vec<Ticket> {
        self.watchers.swap_remove(event).unwrap_or_default()
    }

    /// The entry that waits with this ticket, unless it has left.
    pub(super) fn get(&self, ticket: Ticket) -> Option<&Pending> {
        Some(&self.entries[ticket.0].as_ref()?.what)
    }

    /// Lets what was woken wait for one of the events, or leave if there are none.
    pub(super) fn go_on(&mut self, ticket: Ticket, events: Vec<Event>) {
        if events.is_empty() {
            self.entries[ticket.0] = None;
            self.room += 1;
        } else {
            self.watch(ticket, events);
        }
    }

    fn watch(&mut self, ticket: Ticket, events: Vec<Event>) {
        let Some(entry) = &mut self.entries[ticket.0] else {
            return;
        };
        // One that waits for a single event, as nearly all do, watches nothing when it is woken.
        let is_only = events.len() == 1 && entry.watched.is_empty();
        for event in events {
            if is_only || entry.watched.insert(event.clone()) {
                self.watchers.entry(event).or_default().push(ticket);
            }
        }
    }
}
