//! Duplicate detection: states that have been visited.

use super::super::state::{Projection, State};
use super::Search;
use super::states::is_settled;

/// State numbers by hash: a table of lists, each with the newest state first.
#[derive(Debug, Default)]
pub(super) struct Hashes {
    /// For each value of the low bits, the newest state, or [`END`]. The length is a power of two.
    newest: Vec<u32>,
    /// For each state, half of its hash, and the previous state in its list.
    states: Vec<(u32, u32)>,
}

/// End of a list.
const END: u32 = u32::MAX;

impl Hashes {
    /// Approximate memory of a state, in bytes.
    pub(super) const MEMORY_OF_STATE: usize = 16;

    /// Adds the next state.
    pub(super) fn push(&mut self, hash: u64) {
        self.states.push((half(hash), END));
        if self.states.len() > self.newest.len() {
            self.newest = vec![END; (2 * self.newest.len()).max(64)];
            (0..self.states.len()).for_each(|number| self.link(number));
        } else {
            self.link(self.states.len() - 1);
        }
    }

    fn link(&mut self, number: usize) {
        let list = self.list(self.states[number].0);
        let number_there = u32::try_from(number).unwrap_or(END);
        self.states[number].1 = std::mem::replace(&mut self.newest[list], number_there);
    }

    fn list(&self, half: u32) -> usize {
        half as usize & (self.newest.len() - 1)
    }

    /// Returns the states with this hash, and perhaps a few others.
    pub(super) fn candidates(&self, hash: u64) -> impl Iterator<Item = u32> {
        let half = half(hash);
        let mut next = if self.newest.is_empty() {
            END
        } else {
            self.newest[self.list(half)]
        };
        std::iter::from_fn(move || {
            while next != END {
                let number = next;
                let (found, before) = self.states[number as usize];
                next = before;
                if found == half {
                    return Some(number);
                }
            }
            None
        })
    }
}

fn half(hash: u64) -> u32 {
    let [a, b, c, d, ..] = hash.to_le_bytes();
    u32::from_le_bytes([a, b, c, d])
}

impl Search<'_> {
    /// Returns `true` if a state that is at least as good has been visited.
    pub(super) fn is_known(
        &mut self,
        hash: u64,
        state: &State,
        projection: Option<&Projection>,
    ) -> bool {
        if state.joint.is_some() {
            return false;
        }
        let only_facts_count = self.is_timeless
            && self.step_costs.is_none()
            && state.values.is_empty()
            && is_settled(state);
        let mut variants = 0;
        for number in self.closed_list.candidates(hash) {
            if only_facts_count && !self.states.is_unsettled(number) {
                let facts = &mut self.comparison_buffer.facts;
                if self.states.has_facts_of(number, state, facts) {
                    return true;
                }
                continue;
            }
            let other = if let Some(other) = self.states.whole_or_recent(number) {
                other
            } else {
                self.states.restore(number, &mut self.comparison_buffer);
                &self.comparison_buffer
            };
            if other.joint.is_none() && other.is_discretely(state) {
                let mut is_no_later =
                    self.is_timeless || other.has_no_later_annotations_than(state);
                is_no_later &= self.step_costs.is_none() || other.cost <= state.cost;
                if self.strategy.compresses.is_some() {
                    self.is_lossy |= is_no_later && !state.network.is_empty();
                }
                let notes = self.nodes[number as usize].notes.as_ref();
                let mine = notes.and_then(|notes| notes.projection.as_ref());
                if let (Some(mine), Some(theirs)) = (mine, projection) {
                    is_no_later = is_no_later && mine.is_no_later_than(theirs, self.is_timeless);
                }
                if is_no_later {
                    return true;
                }
                variants += 1;
            }
        }
        if variants >= self.strategy.variants {
            self.is_lossy = true;
            return true;
        }
        false
    }
}
