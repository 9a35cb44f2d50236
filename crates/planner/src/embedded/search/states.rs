//! The states of a search, stored as differences to their parents.
//!
//! A step changes few facts and annotations, while a state may have thousands of both. So a state
//! is stored as the difference to its parent, or, after a number of steps, to the first state. It
//! is restored when its successors are expanded. A small cache holds the states used last.

use std::collections::VecDeque;
use std::sync::Arc;

use super::super::network::SETTLED;
use super::super::state::State;
use super::difference;

/// The maximum length of a chain of differences. The next difference is to the first state, so that
/// restoring takes few steps.
const MAX_LINKS: u8 = 8;

/// The number of states in the cache.
const MAX_RECENT: usize = 8;

/// The number of bytes that are allocated together.
const CHUNK: usize = 1 << 16;

/// Storage of states by number. The first state is number 0.
#[derive(Debug, Default)]
pub(super) struct States {
    stored: Vec<StoredState>,
    /// Complete states: the first one, unsettled ones, and those with large numbers or numbers that depend on
    /// times.
    whole: Vec<Arc<State>>,
    chunks: Vec<Vec<u8>>,
    /// The states used last; the most recent one is at the end.
    recent: VecDeque<(u32, Arc<State>)>,
    /// The difference that is being written.
    buffer: Vec<u8>,
}

/// Location of a stored state.
#[derive(Clone, Copy, Debug)]
struct StoredState {
    /// The state that it differs from; [`WHOLE`] if it is stored completely.
    base: u32,
    /// The chunk and the position in it of the number of links, which the difference follows; or
    /// the index among whole states.
    place: u32,
}

const WHOLE: u32 = u32::MAX;

impl States {
    /// Stores a state whose parent is `parent`, and returns its memory in bytes. The first state
    /// has no parent.
    pub(super) fn push(&mut self, parent: Option<u32>, state: State) -> usize {
        let number = u32::try_from(self.stored.len()).expect("memory is used up long before");
        let state = Arc::new(state);
        let memory = size_of::<StoredState>() + self.store_state(parent, &state);
        if self.whole(number).is_none() {
            self.note(number, state);
        }
        memory
    }

    fn store_state(&mut self, parent: Option<u32>, state: &Arc<State>) -> usize {
        if let Some(parent) = parent.filter(|_| is_settled(state)) {
            let links = match self.stored[parent as usize].base {
                WHOLE => 0,
                _ => self.written_at(parent)[0],
            };
            let (base, links) = if links < MAX_LINKS {
                (parent, links + 1)
            } else {
                (0, 1)
            };
            let from = self.get(base);
            self.buffer.clear();
            self.buffer.push(links);
            if difference::write(&from, state, &mut self.buffer).is_some()
                && let Some(place) = self.store()
            {
                self.stored.push(StoredState { base, place });
                return self.buffer.len();
            }
        }
        self.stored.push(StoredState {
            base: WHOLE,
            place: u32::try_from(self.whole.len()).expect("fewer than there are states"),
        });
        self.whole.push(Arc::clone(state));
        state.size() + 32
    }

    /// Copies the new difference into a chunk. Returns `None` if it does not fit.
    fn store(&mut self) -> Option<u32> {
        let length = self.buffer.len();
        let has_room = |chunk: &Vec<u8>| chunk.len() + length <= CHUNK;
        if !self.chunks.last().is_some_and(has_room) {
            self.chunks.push(Vec::new());
        }
        let number = self.chunks.len() - 1;
        let chunk = &mut self.chunks[number];
        if !has_room(chunk) {
            return None;
        }
        let place = u32::try_from(number * CHUNK + chunk.len()).ok()?;
        chunk.extend_from_slice(&self.buffer);
        Some(place)
    }

    /// Returns the number of links to the next whole state, followed by the difference.
    fn written_at(&self, number: u32) -> &[u8] {
        let place = self.stored[number as usize].place as usize;
        &self.chunks[place / CHUNK][place % CHUNK..]
    }

    /// Returns a state.
    pub(super) fn get(&mut self, number: u32) -> Arc<State> {
        if let Some(state) = self.whole_or_recent(number) {
            let state = Arc::clone(state);
            if self.whole(number).is_none() {
                self.note(number, Arc::clone(&state));
            }
            return state;
        }
        let mut state = State::default();
        self.restore(number, &mut state);
        let state = Arc::new(state);
        self.note(number, Arc::clone(&state));
        state
    }

    /// Returns the state if it need not be restored.
    pub(super) fn whole_or_recent(&self, number: u32) -> Option<&Arc<State>> {
        self.whole(number).or_else(|| {
            let mut recent = self.recent.iter().rev();
            let recent = recent.find(|recent| recent.0 == number)?;
            Some(&recent.1)
        })
    }

    fn whole(&self, number: u32) -> Option<&Arc<State>> {
        let kept = self.stored[number as usize];
        (kept.base == WHOLE).then(|| &self.whole[kept.place as usize])
    }

    /// Returns `true` if some part of the state is not settled.
    pub(super) fn is_unsettled(&self, number: u32) -> bool {
        self.whole(number).is_some_and(|whole| !is_settled(whole))
    }

    /// Returns `true` if the facts and the number of timed initials are the same in both states.
    /// `facts` is a buffer.
    pub(super) fn has_facts_of(&self, number: u32, state: &State, facts: &mut Vec<u64>) -> bool {
        facts.clone_from(&state.facts);
        let (mut base, mut timed) = (number, None);
        let whole = loop {
            if let Some(whole) = self.whole(base) {
                break whole;
            }
            // Changes of facts are their own inverse, in any order.
            let of_link = difference::apply_facts(&self.written_at(base)[1..], facts);
            timed = timed.or(Some(of_link));
            base = self.stored[base as usize].base;
        };
        *facts == whole.facts && timed.unwrap_or(whole.timed) == state.timed
    }

    /// Restores the state.
    pub(super) fn restore(&self, number: u32, state: &mut State) {
        let mut links = Vec::with_capacity(usize::from(MAX_LINKS));
        let mut base = number;
        let whole = loop {
            let whole = if links.len() < 2 {
                self.whole_or_recent(base)
            } else {
                self.whole(base)
            };
            if let Some(whole) = whole {
                break whole;
            }
            links.push(base);
            base = self.stored[base as usize].base;
        };
        copy(whole, state);
        for &link in links.iter().rev() {
            difference::apply(&self.written_at(link)[1..], state);
        }
        if links.is_empty() {
            state.open.clone_from(&whole.open);
            state.network = whole.network.clone();
            (state.last, state.joint) = (whole.last, whole.joint);
            state.symbolic.clone_from(&whole.symbolic);
            return;
        }
        state.open.clear();
        state.network = whole.network.emptied();
        state.last.node = SETTLED;
        state.joint = None;
        state.symbolic = None;
    }

    fn note(&mut self, number: u32, state: Arc<State>) {
        if let Some(place) = self.recent.iter().position(|recent| recent.0 == number) {
            self.recent.remove(place);
        } else if self.recent.len() == MAX_RECENT {
            self.recent.pop_front();
        }
        self.recent.push_back((number, state));
    }
}

/// Returns `true` if all happenings have fixed times, and no action is running.
pub(super) fn is_settled(state: &State) -> bool {
    state.open.is_empty()
        && state.network.is_empty()
        && state.joint.is_none()
        && state.last.node == SETTLED
        && state.symbolic.is_none()
}

/// Copies the parts of a state that a difference covers.
fn copy(from: &State, to: &mut State) {
    to.facts.clone_from(&from.facts);
    to.values.clone_from(&from.values);
    to.annotations.clone_from(&from.annotations);
    to.cost.clone_from(&from.cost);
    to.timed = from.timed;
    to.settled_end = from.settled_end;
    to.last.floor = from.last.floor;
}

#[cfg(test)]
mod tests;
