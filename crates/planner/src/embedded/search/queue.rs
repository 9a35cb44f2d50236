//! What waits for its turn.

use std::collections::{BTreeMap, VecDeque};

use super::super::apply::Step;

/// Successors by rank, the lowest first; of one rank, first come first served.
#[derive(Debug, Default)]
pub(super) struct Queue {
    buckets: BTreeMap<i64, VecDeque<(u32, Step)>>,
}

impl Queue {
    pub(super) fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }

    pub(super) fn push(&mut self, rank: i64, parent: u32, step: Step) {
        self.buckets
            .entry(rank)
            .or_default()
            .push_back((parent, step));
    }

    pub(super) fn pop(&mut self) -> Option<(u32, Step)> {
        let mut first = self.buckets.first_entry()?;
        let entry = first.get_mut().pop_front();
        if first.get().is_empty() {
            first.remove();
        }
        entry
    }
}
