//! The nodes of a search, and notes of some searches about them.

use super::super::apply::Step;
use super::super::compile::Compiled;
use super::super::state::Projection;
use super::novelty::Progress;
use super::runaway::Drift;

/// A node. Its state is stored elsewhere, as most searches need little memory for a node.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) parent: u32,
    /// The number of steps that led to it.
    pub(super) depth: u32,
    /// The number of goals or landmarks left, where that matters.
    pub(super) left: u32,
    pub(super) dead_end: DeadEnd,
    pub(super) step: Step,
    /// `None` if there is nothing to note.
    pub(super) notes: Option<Box<Notes>>,
}

/// Notes about a state, for some searches.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// The part of the unsettled past that matters, in a search that compares it exactly.
    pub(super) projection: Option<Box<Projection>>,
    /// Progress on the path to it, in a search for new states.
    pub(super) progress: Option<Progress>,
    /// The landmarks accepted on the way to it, where they count.
    pub(super) accepted: Box<[u64]>,
    /// For problems with numbers.
    pub(super) drift: Drift,
}

impl Notes {
    pub(super) fn has_any(&self, compiled: &Compiled) -> bool {
        self.projection.is_some() || !self.accepted.is_empty() || !compiled.fluents.is_empty()
    }

    /// An estimate of the memory that they take, in bytes.
    pub(super) fn size(&self) -> usize {
        let projection = self.projection.as_ref();
        size_of::<Self>()
            + projection.map_or(0, |projection| projection.size())
            + 8 * self.accepted.len()
    }
}

impl Node {
    pub(super) fn progress(&self) -> Option<&Progress> {
        self.notes.as_ref()?.progress.as_ref()
    }

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
