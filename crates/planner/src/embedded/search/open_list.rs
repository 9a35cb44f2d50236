//! Queues of successors, by rank.

use std::collections::BTreeMap;

use super::super::apply::Step;
use super::successor_list::{QueuedSuccessor, SuccessorList};

/// Successors by rank, the lowest first; within a rank, in order of insertion.
#[derive(Debug, Default)]
pub(super) struct OpenList {
    buckets: BTreeMap<i64, SuccessorList>,
    is_turn_of_newest: bool,
}

impl OpenList {
    pub(super) fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }

    /// Adds a successor, and returns its memory in bytes.
    pub(super) fn push(&mut self, rank: i64, waiting: QueuedSuccessor) -> usize {
        self.buckets.entry(rank).or_default().push_back(waiting)
    }

    /// Removes the first successor. Returns it with its rank.
    pub(super) fn pop(&mut self) -> Option<(i64, QueuedSuccessor)> {
        self.pop_from(false)
    }

    /// Inserts successors of a state before all others of that rank.
    pub(super) fn push_first(&mut self, rank: i64, parent: u32, steps: &[Step]) {
        if steps.is_empty() {
            return;
        }
        let bucket = self.buckets.entry(rank).or_default();
        for &step in steps.iter().rev() {
            bucket.push_front(QueuedSuccessor::step(parent, step));
        }
    }

    /// As [`pop`](Queue::pop), but alternates between the newest and the oldest successor of the
    /// first rank.
    ///
    /// With the oldest first, a search visits a whole plateau before it continues from any of its
    /// states. With the newest first, it proceeds depth-first, and plans are long.
    pub(super) fn pop_alternately(&mut self) -> Option<(i64, QueuedSuccessor)> {
        self.is_turn_of_newest = !self.is_turn_of_newest;
        self.pop_from(self.is_turn_of_newest)
    }

    fn pop_from(&mut self, newest: bool) -> Option<(i64, QueuedSuccessor)> {
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
    use super::{OpenList, QueuedSuccessor, Step};

    fn filled() -> OpenList {
        let mut queue = OpenList::default();
        for (rank, parent) in [(2, 9), (1, 0), (1, 1), (1, 2), (1, 3)] {
            queue.push(rank, QueuedSuccessor::step(parent, Step::Timed));
        }
        queue
    }

    fn parents(mut next: impl FnMut() -> Option<(i64, QueuedSuccessor)>) -> Vec<u32> {
        std::iter::from_fn(|| Some(next()?.1.parent)).collect()
    }

    #[test]
    fn queue_is_ordered_by_rank_then_insertion() {
        let mut queue = filled();
        assert_eq!(parents(|| queue.pop()), [0, 1, 2, 3, 9]);
        assert!(queue.is_empty());
    }

    #[test]
    fn newest_and_oldest_of_lowest_rank_alternate() {
        let mut queue = filled();
        assert_eq!(parents(|| queue.pop_alternately()), [3, 0, 2, 1, 9]);
        assert!(queue.is_empty());
    }

    #[test]
    fn listed_successors_take_position_of_their_parent() {
        let mut queue = filled();
        queue.push(0, QueuedSuccessor::all_of(7));
        queue.push(0, QueuedSuccessor::all_of(8));
        let (rank, first) = queue.pop().unwrap();
        assert_eq!((rank, first), (0, QueuedSuccessor::all_of(7)));
        queue.push_first(rank, 7, &[Step::Start(1), Step::End(0)]);
        let steps: Vec<_> = std::iter::from_fn(|| queue.pop()).take(3).collect();
        let expected = [
            QueuedSuccessor::step(7, Step::Start(1)),
            QueuedSuccessor::step(7, Step::End(0)),
            QueuedSuccessor::all_of(8),
        ];
        assert_eq!(steps, expected.map(|waiting| (0, waiting)));
        queue.push_first(0, 8, &[]);
        assert_eq!(parents(|| queue.pop()), [0, 1, 2, 3, 9]);
    }
}
