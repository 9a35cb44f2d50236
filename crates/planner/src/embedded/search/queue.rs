//! Queues of successors, by rank.

use std::collections::BTreeMap;

use super::super::apply::Step;
use super::waiting::{Waiting, WaitingList};

/// Successors by rank, the lowest first; within a rank, in order of insertion.
#[derive(Debug, Default)]
pub(super) struct Queue {
    buckets: BTreeMap<i64, WaitingList>,
    is_turn_of_newest: bool,
}

impl Queue {
    pub(super) fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }

    /// Adds a successor, and returns its memory in bytes.
    pub(super) fn push(&mut self, rank: i64, waiting: Waiting) -> usize {
        self.buckets.entry(rank).or_default().push_back(waiting)
    }

    /// Removes the first successor. Returns it with its rank.
    pub(super) fn pop(&mut self) -> Option<(i64, Waiting)> {
        self.pop_from(false)
    }

    /// Inserts successors of a state before all others of that rank.
    pub(super) fn put_back(&mut self, rank: i64, parent: u32, steps: &[Step]) {
        if steps.is_empty() {
            return;
        }
        let bucket = self.buckets.entry(rank).or_default();
        for &step in steps.iter().rev() {
            bucket.push_front(Waiting::step(parent, step));
        }
    }

    /// As [`pop`](Queue::pop), but alternates between the newest and the oldest successor of the
    /// first rank.
    ///
    /// With the oldest first, a search visits a whole plateau before it continues from any of its
    /// states. With the newest first, it proceeds depth-first, and plans are long.
    pub(super) fn pop_alternately(&mut self) -> Option<(i64, Waiting)> {
        self.is_turn_of_newest = !self.is_turn_of_newest;
        self.pop_from(self.is_turn_of_newest)
    }

    fn pop_from(&mut self, newest: bool) -> Option<(i64, Waiting)> {
        let mut first = self.buckets.first_entry()?;
        let rank = *first.key();
        let waiting = if newest {
            first.get_mut().pop_back()
        } else {
            first.get_mut().pop_front()
        };
        if first.get().is_empty() {
            first.remove();
        }
        waiting.map(|waiting| (rank, waiting))
    }
}

#[cfg(test)]
mod tests {
    use super::{Queue, Step, Waiting};

    fn filled() -> Queue {
        let mut queue = Queue::default();
        for (rank, parent) in [(2, 9), (1, 0), (1, 1), (1, 2), (1, 3)] {
            queue.push(rank, Waiting::step(parent, Step::Timed));
        }
        queue
    }

    fn parents(mut next: impl FnMut() -> Option<(i64, Waiting)>) -> Vec<u32> {
        std::iter::from_fn(|| Some(next()?.1.parent)).collect()
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

    #[test]
    fn successors_of_a_state_come_in_its_place_when_they_are_listed() {
        let mut queue = filled();
        queue.push(0, Waiting::all_of(7));
        queue.push(0, Waiting::all_of(8));
        let (rank, first) = queue.pop().unwrap();
        assert_eq!((rank, first), (0, Waiting::all_of(7)));
        queue.put_back(rank, 7, &[Step::Start(1), Step::End(0)]);
        let steps: Vec<_> = std::iter::from_fn(|| queue.pop()).take(3).collect();
        let expected = [
            Waiting::step(7, Step::Start(1)),
            Waiting::step(7, Step::End(0)),
            Waiting::all_of(8),
        ];
        assert_eq!(steps, expected.map(|waiting| (0, waiting)));
        queue.put_back(0, 8, &[]);
        assert_eq!(parents(|| queue.pop()), [0, 1, 2, 3, 9]);
    }
}
