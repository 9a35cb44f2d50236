//! Compact double-ended queue of successors.
//!
//! An entry is stored as its difference to the entry before it: one or two bytes for most
//! successors of one state. It can be read from both ends, because the last byte of each number is
//! marked, and so is the last number of each entry.

use std::collections::VecDeque;

use super::super::apply::Step;

/// A queued successor, or all successors of a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct QueuedSuccessor {
    pub(super) parent: u32,
    /// The kind of the step in the highest bits, and its number.
    step: u32,
}

/// The number of bits for the number of a step.
const NUMBER_BITS: u32 = 29;

/// Marks the last byte of a number.
const LAST: u8 = 1 << 7;

impl QueuedSuccessor {
    pub(super) fn step(parent: u32, step: Step) -> Self {
        let (number, kind) = match step {
            Step::Start(action) => (action, 0),
            Step::Compressed(action) => (action, 1),
            Step::Macro(number) => (number, 2),
            Step::End(place) => (place, 3),
            Step::Timed => (0, 4),
        };
        debug_assert!(number < 1 << NUMBER_BITS, "memory is used up long before");
        let step = kind << NUMBER_BITS | number;
        Self { parent, step }
    }

    /// Returns an entry for all successors of a state, which are listed when it is removed.
    pub(super) fn all_of(parent: u32) -> Self {
        let step = 5 << NUMBER_BITS;
        Self { parent, step }
    }

    /// Returns the step, or `None` for all of them.
    pub(super) fn next(self) -> Option<Step> {
        let number = self.step & ((1 << NUMBER_BITS) - 1);
        match self.step >> NUMBER_BITS {
            0 => Some(Step::Start(number)),
            1 => Some(Step::Compressed(number)),
            2 => Some(Step::Macro(number)),
            3 => Some(Step::End(number)),
            4 => Some(Step::Timed),
            _ => None,
        }
    }

    /// Returns the differences of the steps and of the states to the previous entry.
    fn since(self, before: Self) -> (i64, i64) {
        let difference = |new: u32, old: u32| i64::from(new) - i64::from(old);
        let parents = difference(self.parent, before.parent);
        (difference(self.step, before.step), parents)
    }

    /// Returns the entry at a difference; `sign` is 1 for the next one and -1 for the previous one.
    fn moved(self, (step, parent): (i64, i64), sign: i64) -> Self {
        let moved = |old: u32, difference: i64| {
            u32::try_from(i64::from(old) + sign * difference).unwrap_or(u32::MAX)
        };
        Self {
            parent: moved(self.parent, parent),
            step: moved(self.step, step),
        }
    }
}

/// Compact double-ended queue.
#[derive(Debug, Default)]
pub(super) struct SuccessorList {
    bytes: VecDeque<u8>,
    /// The entry to which the first one is a difference.
    before: QueuedSuccessor,
    /// The last entry.
    last: QueuedSuccessor,
}

impl SuccessorList {
    pub(super) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    /// Adds an entry at the end, and returns its memory in bytes.
    pub(super) fn push_back(&mut self, entry: QueuedSuccessor) -> usize {
        if self.is_empty() {
            self.before = entry;
            self.last = entry;
        }
        let bytes = Written::of(entry.since(self.last));
        self.reserve(bytes.length);
        self.bytes.extend(bytes.get());
        self.last = entry;
        bytes.length
    }

    /// Adds an entry before all others.
    pub(super) fn push_front(&mut self, entry: QueuedSuccessor) {
        let Some(first) = self.pop_front() else {
            self.push_back(entry);
            return;
        };
        self.before = entry;
        if self.is_empty() {
            self.last = first;
        }
        for difference in [first.since(entry), (0, 0)] {
            let bytes = Written::of(difference);
            self.reserve(bytes.length);
            for &byte in bytes.get().iter().rev() {
                self.bytes.push_front(byte);
            }
        }
    }

    pub(super) fn pop_front(&mut self) -> Option<QueuedSuccessor> {
        let mut take = || {
            let (mut number, mut shift) = (0, 0);
            loop {
                let byte = self.bytes.pop_front()?;
                number |= u64::from(byte & !LAST) << shift;
                shift += 7;
                if byte & LAST != 0 {
                    return Some(number);
                }
            }
        };
        let step = take()?;
        let parent = if step & 1 == 0 { 0 } else { take()? };
        self.before = self.before.moved(difference(step, parent), 1);
        Some(self.before)
    }

    pub(super) fn pop_back(&mut self) -> Option<QueuedSuccessor> {
        let mut take = || {
            let mut number = u64::from(self.bytes.pop_back()? & !LAST);
            while let Some(byte) = self.bytes.back().filter(|&byte| byte & LAST == 0) {
                number = number << 7 | u64::from(*byte);
                self.bytes.pop_back();
            }
            Some(number)
        };
        let last = take()?;
        let (step, parent) = if last & 1 == 0 {
            (last, 0)
        } else {
            (take()?, last)
        };
        let entry = self.last;
        self.last = entry.moved(difference(step, parent), -1);
        Some(entry)
    }

    /// Reserves memory. Long lists grow by a quarter, so that little memory is unused.
    fn reserve(&mut self, additional: usize) {
        let length = self.bytes.len();
        if length + additional > self.bytes.capacity() {
            self.bytes.reserve_exact(additional.max(length / 4).max(16));
        }
    }
}

/// Decodes the differences of steps and of states from two numbers. Their lowest bits are the kinds of number.
fn difference(step: u64, parent: u64) -> (i64, i64) {
    let signed = |number: u64| (number >> 1).cast_signed() ^ -(number & 1).cast_signed();
    (signed(step >> 1), signed(parent >> 1))
}

/// A difference in bytes: the step's, and where the state differs, the state's.
struct Written {
    bytes: [u8; 2 * 5],
    length: usize,
}

impl Written {
    fn of((step, parent): (i64, i64)) -> Self {
        let mut written = Self {
            bytes: [0; 2 * 5],
            length: 0,
        };
        let unsigned = |number: i64| ((number << 1) ^ (number >> 63)).cast_unsigned();
        written.put(unsigned(step) << 1 | u64::from(parent != 0));
        if parent != 0 {
            written.put(unsigned(parent) << 1 | 1);
        }
        written
    }

    fn put(&mut self, mut number: u64) {
        while number >= u64::from(LAST) {
            self.push(number.to_le_bytes()[0] & !LAST);
            number >>= 7;
        }
        self.push(number.to_le_bytes()[0] | LAST);
    }

    fn push(&mut self, byte: u8) {
        self.bytes[self.length] = byte;
        self.length += 1;
    }

    fn get(&self) -> &[u8] {
        &self.bytes[..self.length]
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use proptest::prelude::*;

    use super::{QueuedSuccessor, Step, SuccessorList};

    #[test]
    fn step_round_trips() {
        for number in [0, 1, 7, 8, (1 << 29) - 1] {
            let steps = [
                Step::Start(number),
                Step::Compressed(number),
                Step::Macro(number),
                Step::End(number),
                Step::Timed,
            ];
            for step in steps {
                assert_eq!(QueuedSuccessor::step(3, step).next(), Some(step));
            }
        }
        assert_eq!(QueuedSuccessor::all_of(3).next(), None);
    }

    #[test]
    fn sibling_successors_take_one_byte_each() {
        let mut list = SuccessorList::default();
        let steps = (100..130).map(|action| QueuedSuccessor::step(7, Step::Start(action)));
        let bytes: Vec<usize> = steps.map(|step| list.push_back(step)).collect();
        assert_eq!(bytes, [1; 30]);
    }

    /// An operation on a list.
    #[derive(Clone, Copy, Debug)]
    enum Operation {
        PushBack(QueuedSuccessor),
        PushFront(QueuedSuccessor),
        PopBack,
        PopFront,
    }

    fn operations() -> impl Strategy<Value = Vec<Operation>> {
        let number = prop_oneof![0_u32..3, 0_u32..300, 0..u32::MAX];
        let entry =
            (number.clone(), number).prop_map(|(parent, step)| QueuedSuccessor { parent, step });
        let operation = prop_oneof![
            3 => entry.clone().prop_map(Operation::PushBack),
            1 => entry.prop_map(Operation::PushFront),
            1 => Just(Operation::PopBack),
            1 => Just(Operation::PopFront),
        ];
        prop::collection::vec(operation, 0..80)
    }

    proptest! {
        #[test]
        fn list_is_a_double_ended_queue(operations in operations()) {
            let (mut list, mut plain) = (SuccessorList::default(), VecDeque::new());
            for operation in operations {
                match operation {
                    Operation::PushBack(entry) => {
                        list.push_back(entry);
                        plain.push_back(entry);
                    }
                    Operation::PushFront(entry) => {
                        list.push_front(entry);
                        plain.push_front(entry);
                    }
                    Operation::PopBack => prop_assert_eq!(list.pop_back(), plain.pop_back()),
                    Operation::PopFront => prop_assert_eq!(list.pop_front(), plain.pop_front()),
                }
                prop_assert_eq!(list.is_empty(), plain.is_empty());
            }
            let rest: Vec<_> = std::iter::from_fn(|| list.pop_front()).collect();
            prop_assert_eq!(rest, Vec::from(plain));
        }
    }
}
