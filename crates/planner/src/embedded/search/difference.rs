//! Difference between two settled states, as a short sequence of bytes.
//!
//! Numbers are written in groups of seven bits, the low ones first. For lists, only the changes are
//! written: the distance from the last changed position, and the change; 0 ends the list.

use elbowroom_num::Rational;

use super::super::state::State;
use super::super::time::Ticks;

/// Writes the difference of `state` from `base`. Returns `None` if it contains a number that is too
/// large.
pub(super) fn write(base: &State, state: &State, bytes: &mut Vec<u8>) -> Option<()> {
    put(bytes, u64::from(state.timed));
    let mut places = Places::default();
    for (word, (old, new)) in base.facts.iter().zip(&state.facts).enumerate() {
        let mut changed = old ^ new;
        while changed != 0 {
            places.put(bytes, 64 * word + changed.trailing_zeros() as usize);
            changed &= changed - 1;
        }
    }
    put(bytes, 0);
    put_change(bytes, base.settled_end, state.settled_end);
    put_change(bytes, base.last.floor, state.last.floor);
    put_number(bytes, (state.cost != base.cost).then_some(&state.cost))?;
    put_annotations(bytes, base, state);
    let mut places = Places::default();
    for (place, (old, new)) in base.values.iter().zip(&state.values).enumerate() {
        if old != new {
            places.put(bytes, place);
            put_number(bytes, new.as_ref())?;
        }
    }
    put(bytes, 0);
    Some(())
}

/// Number of annotations that are compared at once.
const BLOCK: usize = 16;

fn put_annotations(bytes: &mut Vec<u8>, base: &State, state: &State) {
    let mut places = Places::default();
    // Most of them are equal to the one before.
    let mut before = state.settled_end;
    let blocks = base.annotations.chunks(BLOCK);
    for (block, (old, new)) in blocks.zip(state.annotations.chunks(BLOCK)).enumerate() {
        if old == new {
            continue;
        }
        for (place, (old, new)) in old.iter().zip(new).enumerate() {
            if old != new {
                places.put(bytes, BLOCK * block + place);
                put_change(bytes, before, *new);
                before = *new;
            }
        }
    }
    put(bytes, 0);
}

/// Turns a copy of the base into the state that was written.
pub(super) fn apply(bytes: &[u8], state: &mut State) {
    let mut bytes = Bytes(bytes);
    state.timed = bytes.take_timed();
    bytes.take_facts(&mut state.facts);
    state.settled_end = bytes.take_change(state.settled_end);
    state.last.floor = bytes.take_change(state.last.floor);
    if let Some(cost) = bytes.take_number() {
        state.cost = cost;
    }
    let (mut place, mut before) = (0, state.settled_end);
    while bytes.moves(&mut place) {
        before = bytes.take_change(before);
        state.annotations[place - 1] = before;
    }
    let mut place = 0;
    while bytes.moves(&mut place) {
        state.values[place - 1] = bytes.take_number();
    }
}

/// Applies the written changes of facts, and returns the number of timed initials that have
/// happened.
pub(super) fn apply_facts(bytes: &[u8], facts: &mut [u64]) -> u32 {
    let mut bytes = Bytes(bytes);
    let timed = bytes.take_timed();
    bytes.take_facts(facts);
    timed
}

/// The positions of a list, in ascending order.
#[derive(Default)]
struct Places {
    /// The last position plus one.
    last: usize,
}

impl Places {
    fn put(&mut self, bytes: &mut Vec<u8>, place: usize) {
        put(bytes, (place + 1 - self.last) as u64);
        self.last = place + 1;
    }
}

fn put(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 1 << 7 {
        bytes.push(low_bits(number) | 1 << 7);
        number >>= 7;
    }
    bytes.push(low_bits(number));
}

fn low_bits(number: u64) -> u8 {
    number.to_le_bytes()[0] & 0x7f
}

/// Writes a signed number so that small absolute values are short.
fn put_signed(bytes: &mut Vec<u8>, number: i64) {
    put(bytes, ((number << 1) ^ (number >> 63)).cast_unsigned());
}

fn put_change(bytes: &mut Vec<u8>, old: Ticks, new: Ticks) {
    put_signed(bytes, new.wrapping_sub(old));
}

/// Writes the denominator and the numerator; a denominator of 0 for no value.
fn put_number(bytes: &mut Vec<u8>, number: Option<&Rational>) -> Option<()> {
    let Some(number) = number else {
        put(bytes, 0);
        return Some(());
    };
    let (numerator, denominator) = number.as_small()?;
    put(bytes, denominator.cast_unsigned());
    put_signed(bytes, numerator);
    Some(())
}

/// The bytes that have not been read.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take(&mut self) -> u64 {
        let (byte, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        let low = u64::from(byte & 0x7f);
        if *byte < 1 << 7 {
            low
        } else {
            low | self.take() << 7
        }
    }

    fn take_timed(&mut self) -> u32 {
        u32::try_from(self.take()).unwrap_or(u32::MAX)
    }

    fn take_facts(&mut self, facts: &mut [u64]) {
        let mut place = 0;
        while self.moves(&mut place) {
            facts[(place - 1) / 64] ^= 1 << ((place - 1) % 64);
        }
    }

    /// Moves to the next position of a list, counted from 1. Returns `false` at the end.
    fn moves(&mut self, place: &mut usize) -> bool {
        let distance = usize::try_from(self.take()).unwrap_or(usize::MAX);
        *place += distance;
        distance > 0
    }

    fn take_signed(&mut self) -> i64 {
        let number = self.take();
        (number >> 1).cast_signed() ^ -(number & 1).cast_signed()
    }

    fn take_change(&mut self, old: Ticks) -> Ticks {
        old.wrapping_add(self.take_signed())
    }

    fn take_number(&mut self) -> Option<Rational> {
        let denominator = self.take().cast_signed();
        (denominator != 0).then(|| Rational::new(self.take_signed(), denominator))
    }
}

#[cfg(test)]
mod tests {
    use elbowroom_num::Rational;
    use proptest::prelude::*;

    use super::{apply, apply_facts, write};
    use crate::embedded::state::State;

    fn states() -> impl Strategy<Value = State> {
        let number = (any::<i64>(), 1_i64..9).prop_map(|(n, d)| Rational::new(n / 2, d));
        (
            prop::collection::vec(any::<u64>(), 3),
            prop::collection::vec(prop::option::of(number.clone()), 4),
            number,
            prop::collection::vec(any::<i64>().prop_map(|time| time / 4), 40),
            (any::<u32>(), -9_i64..9, any::<i64>()),
        )
            .prop_map(|(facts, values, cost, annotations, times)| {
                let mut state = State {
                    facts,
                    values,
                    cost,
                    annotations,
                    timed: times.0,
                    settled_end: times.1,
                    ..State::default()
                };
                state.last.floor = times.2;
                state
            })
    }

    /// Returns a state with some parts of one state and the others of another one.
    fn mixed(one: &State, other: &State, choices: &[bool]) -> State {
        let mut mixed = one.clone();
        let mut choices = choices.iter().cycle();
        for (place, fact) in mixed.facts.iter_mut().zip(&other.facts) {
            if *choices.next().expect("endless") {
                *place = *fact;
            }
        }
        for (place, value) in mixed.values.iter_mut().zip(&other.values) {
            if *choices.next().expect("endless") {
                place.clone_from(value);
            }
        }
        for (place, time) in mixed.annotations.iter_mut().zip(&other.annotations) {
            if *choices.next().expect("endless") {
                *place = *time;
            }
        }
        if *choices.next().expect("endless") {
            mixed.cost.clone_from(&other.cost);
            mixed.timed = other.timed;
        }
        mixed
    }

    proptest! {
        #[test]
        fn difference_reconstructs_other_state(
            one in states(),
            other in states(),
            choices in prop::collection::vec(any::<bool>(), 50),
        ) {
            let new = mixed(&one, &other, &choices);
            let mut bytes = Vec::new();
            write(&one, &new, &mut bytes).expect("small numbers");
            let mut facts = one.facts.clone();
            prop_assert_eq!(apply_facts(&bytes, &mut facts), new.timed);
            prop_assert_eq!(&facts, &new.facts);
            let mut made = one;
            apply(&bytes, &mut made);
            prop_assert_eq!(format!("{made:?}"), format!("{new:?}"));
        }
    }
}
