//! The nodes of a search, and notes of some searches about them.

use std::hash::Hash;

use super::super::compile::Compiled;
use super::super::hash::Map;
use super::super::state::Projection;
use super::novelty::Progress;
use super::runaway::Drift;
use super::serialization::Agenda;
use super::successor_list::QueuedSuccessor;

/// A node. Its state is stored separately, as most searches need little memory for a node.
#[derive(Debug)]
pub(super) struct Node {
    /// The previous node, and the step that led here.
    pub(super) origin: QueuedSuccessor,
    /// The number of remaining goals or landmarks, where that matters.
    pub(super) remaining: u32,
    /// Number of its [accepted landmarks](SharedNotes::accepted), or [`NONE`].
    pub(super) accepted: u32,
    /// Number of its [progress](SharedNotes::progress), or [`NONE`].
    pub(super) progress: u32,
    /// Number of its [agenda](SharedNotes::agendas), or [`NONE`].
    pub(super) agenda: u32,
    pub(super) dead_end: DeadEnd,
    /// `None` if there are no notes.
    pub(super) notes: Option<Box<Notes>>,
}

/// Notes about a state, for some searches.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// The relevant part of the unsettled happenings, in a search that compares it exactly.
    pub(super) projection: Option<Box<Projection>>,
    /// For problems with numbers.
    pub(super) drift: Drift,
}

impl Notes {
    pub(super) fn has_any(&self, compiled: &Compiled) -> bool {
        self.projection.is_some() || !compiled.fluents.is_empty()
    }

    /// Returns an estimate of the memory, in bytes.
    pub(super) fn size(&self) -> usize {
        let projection = self.projection.as_ref();
        size_of::<Self>() + projection.map_or(0, |projection| projection.size())
    }
}

impl Node {
    pub(super) fn drift(&self) -> Drift {
        self.notes
            .as_ref()
            .map_or_else(Drift::default, |notes| notes.drift)
    }
}

/// The stronger bound's verdict on a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum DeadEnd {
    /// Not computed.
    Unchecked,
    /// No proof was found, or the budget did not permit a check.
    Unproved,
    /// No plan passes through the state.
    Proved,
}

/// No shared note.
pub(super) const NONE: u32 = u32::MAX;

/// Notes shared by many nodes.
#[derive(Debug, Default)]
pub(super) struct SharedNotes {
    /// The landmarks accepted on the way to a node, where they count.
    pub(super) accepted: Shared<Box<[u64]>>,
    /// Progress on the path to a node, in a search by the novelty of successors.
    pub(super) progress: Shared<Progress>,
    /// The subgoals, in a search that serializes the goal.
    pub(super) agendas: Shared<Agenda>,
}

/// Numbered values without duplicates.
#[derive(Debug)]
pub(super) struct Shared<T> {
    values: Map<T, ()>,
}

impl<T> Default for Shared<T> {
    fn default() -> Self {
        Self {
            values: Map::default(),
        }
    }
}

/// Approximate memory of a table entry, in bytes, without the value.
const MEMORY_OF_ENTRY: usize = 32;

impl<T: Hash + Eq> Shared<T> {
    /// Returns the number of a value, and the memory of the entry if the value is new. `size` is
    /// the size of the value.
    pub(super) fn number(&mut self, value: T, size: usize) -> (u32, usize) {
        let (number, known) = self.values.insert_full(value, ());
        let memory = known.map_or(MEMORY_OF_ENTRY + size, |()| 0);
        (u32::try_from(number).unwrap_or(NONE), memory)
    }

    pub(super) fn get(&self, number: u32) -> Option<&T> {
        let (value, ()) = self.values.get_index(number as usize)?;
        Some(value)
    }
}
