//! The nodes of a search, and notes of some searches about them.

use std::hash::Hash;

use super::super::compile::Compiled;
use super::super::hash::Map;
use super::super::state::Projection;
use super::novelty::Progress;
use super::runaway::Drift;
use super::waiting::Waiting;

/// A node. Its state is stored elsewhere, as most searches need little memory for a node.
#[derive(Debug)]
pub(super) struct Node {
    /// The node before it, and the step that led here.
    pub(super) origin: Waiting,
    /// The number of goals or landmarks left, where that matters.
    pub(super) left: u32,
    /// Number of its [accepted landmarks](SharedNotes::accepted), or [`NONE`].
    pub(super) accepted: u32,
    /// Number of its [progress](SharedNotes::progress), or [`NONE`].
    pub(super) progress: u32,
    pub(super) dead_end: DeadEnd,
    /// `None` if there is nothing to note.
    pub(super) notes: Option<Box<Notes>>,
}

/// Notes about a state, for some searches.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// The part of the unsettled past that matters, in a search that compares it exactly.
    pub(super) projection: Option<Box<Projection>>,
    /// For problems with numbers.
    pub(super) drift: Drift,
}

impl Notes {
    pub(super) fn has_any(&self, compiled: &Compiled) -> bool {
        self.projection.is_some() || !compiled.fluents.is_empty()
    }

    /// An estimate of the memory that they take, in bytes.
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
    /// It was not asked.
    Unchecked,
    /// There may be a plan, or such checks have been given up.
    Unproved,
    /// No plan goes through the state.
    Proved,
}

/// No shared note.
pub(super) const NONE: u32 = u32::MAX;

/// Notes that many nodes have in common.
#[derive(Debug, Default)]
pub(super) struct SharedNotes {
    /// The landmarks accepted on the way to a node, where they count.
    pub(super) accepted: Shared<Box<[u64]>>,
    /// Progress on the path to a node, in a search for new successors.
    pub(super) progress: Shared<Progress>,
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

/// An estimate of the memory that a table needs for an entry, in bytes, without the value.
const MEMORY_OF_ENTRY: usize = 32;

impl<T: Hash + Eq> Shared<T> {
    /// Returns the number of a value, and the memory that it takes if it is new. `size`: that of the value.
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
