//! What waits for its turn.

use std::collections::{BTreeMap, VecDeque};

use super::super::apply::Step;

/// Successors by rank, the lowest first; of one rank, first come first served.
#[derive(Debug, Default)]
pub(super) struct Queue {
    buckets: BTreeMap<i64, VecDeque<(u32, Step)>>,
    is_turn_of_newest: bool,
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
        self.pop_from(false)
    }

    /// The same, but of the first rank the newest and the oldest take turns.
    ///
    /// The oldest first, a search looks at all of a plateau before it goes on from any of its
    /// states; the newest first, it goes straight on, and plans are long.
    pub(super) fn pop_alternately(&mut self) -> Option<(u32, Step)> {
        self.is_turn_of_newest = !self.is_turn_of_newest;
        self.pop_from(self.is_turn_of_newest)
    }

    fn pop_from(&mut self, newest: bool) -> Option<(u32, Step)> {
        let mut first = self.buckets.first_entry()?;
        let entry = if newest {
            first.get_mut().pop_back()
        } else {
            first.get_mut().pop_front()
        };
        if first.get().is_empty() {
            first.remove();
        }
        entry
    }
}

#[cfg(test)]
mod tests {
    use super::{Queue, Step};

    fn filled() -> Queue {
        let mut queue = Queue::default();
        for (rank, parent) in [(2, 9), (1, 0), (1, 1), (1, 2), (1, 3)] {
            queue.push(rank, parent, Step::Timed);
        }
        queue
    }

    fn parents(mut next: impl FnMut() -> Option<(u32, Step)>) -> Vec<u32> {
        std::iter::from_fn(|| Some(next()?.0)).collect()
    }

    #[test]
    fn the_lowest_rank_is_first_and_of_one_rank_who_came_first() {
        let mut queue = filled();
        assert_eq!(parents(|| queue.pop()), [0, 1, 2, 3, 9]);
        assert!(queue.is_empty());
    }

    #[test]
    fn the_newest_and_the_oldest_of_the_lowest_rank_take_turns() {
        let mut queue = filled();
        assert_eq!(parents(|| queue.pop_alternately()), [3, 0, 2, 1, 9]);
        assert!(queue.is_empty());
    }
}
