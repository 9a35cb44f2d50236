//! What waits for its turn.

use std::collections::{BTreeMap, VecDeque};

use super::super::apply::Step;

/// A successor that waits, or all successors of a state. Many wait, so each is small.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Waiting {
    pub(super) parent: u32,
    /// The number of the step, and in the lowest bits its kind.
    step: u32,
}

/// The number of bits for the kind of a step.
const KIND_BITS: u32 = 3;

impl Waiting {
    pub(super) fn step(parent: u32, step: Step) -> Self {
        let (number, kind) = match step {
            Step::Start(action) => (action, 0),
            Step::Compressed(action) => (action, 1),
            Step::Macro(number) => (number, 2),
            Step::End(place) => (place, 3),
            Step::Timed => (0, 4),
        };
        debug_assert!(
            number < 1 << (u32::BITS - KIND_BITS),
            "memory is used up long before"
        );
        let step = number << KIND_BITS | kind;
        Self { parent, step }
    }

    /// All successors, which are listed when their turn comes.
    pub(super) fn all_of(parent: u32) -> Self {
        Self { parent, step: 5 }
    }

    /// The step; `None` for all of them.
    pub(super) fn next(self) -> Option<Step> {
        let number = self.step >> KIND_BITS;
        match self.step & ((1 << KIND_BITS) - 1) {
            0 => Some(Step::Start(number)),
            1 => Some(Step::Compressed(number)),
            2 => Some(Step::Macro(number)),
            3 => Some(Step::End(number)),
            4 => Some(Step::Timed),
            _ => None,
        }
    }
}

/// Successors by rank, the lowest first; of one rank, first come first served.
#[derive(Debug, Default)]
pub(super) struct Queue {
    buckets: BTreeMap<i64, VecDeque<Waiting>>,
    is_turn_of_newest: bool,
}

impl Queue {
    pub(super) fn is_empty(&self) -> bool {
        self.buckets.is_empty()
    }

    pub(super) fn push(&mut self, rank: i64, waiting: Waiting) {
        self.buckets.entry(rank).or_default().push_back(waiting);
    }

    /// The first one, and its rank.
    pub(super) fn pop(&mut self) -> Option<(i64, Waiting)> {
        self.pop_from(false)
    }

    /// Puts successors of a state before all others of that rank.
    pub(super) fn put_back(&mut self, rank: i64, parent: u32, steps: &[Step]) {
        if steps.is_empty() {
            return;
        }
        let bucket = self.buckets.entry(rank).or_default();
        for &step in steps.iter().rev() {
            bucket.push_front(Waiting::step(parent, step));
        }
    }

    /// The same as [`pop`](Queue::pop), but of the first rank the newest and the oldest take turns.
    ///
    /// The oldest first, a search looks at all of a plateau before it goes on from any of its
    /// states; the newest first, it goes straight on, and plans are long.
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

    #[test]
    fn a_step_is_read_as_it_was_written() {
        for number in [0, 1, 7, 8, (1 << 29) - 1] {
            let steps = [
                Step::Start(number),
                Step::Compressed(number),
                Step::Macro(number),
                Step::End(number),
                Step::Timed,
            ];
            for step in steps {
                assert_eq!(Waiting::step(3, step).next(), Some(step));
            }
        }
        assert_eq!(Waiting::all_of(3).next(), None);
    }
}
