//! A fast hash for short keys of small numbers.
//!
//! Grounding hashes millions of atoms; the standard hash would take a third of its time. The
//! iteration order never depends on hashes, because all tables keep insertion order.

use std::hash::{BuildHasherDefault, Hasher};

use indexmap::{IndexMap, IndexSet};

/// A map in insertion order.
pub(crate) type Map<K, V> = IndexMap<K, V, BuildHasherDefault<MixHasher>>;
/// A set in insertion order.
pub(crate) type Set<K> = IndexSet<K, BuildHasherDefault<MixHasher>>;

/// Rotate, mix in, multiply: the scheme of Firefox and the Rust compiler.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct MixHasher(u64);

impl MixHasher {
    fn mix(&mut self, word: u64) {
        self.0 = (self.0.rotate_left(5) ^ word).wrapping_mul(0x517c_c1b7_2722_0a95);
    }
}

impl Hasher for MixHasher {
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.mix(u64::from(byte));
        }
    }

    fn write_u32(&mut self, number: u32) {
        self.mix(u64::from(number));
    }

    fn write_u64(&mut self, number: u64) {
        self.mix(number);
    }

    fn write_usize(&mut self, number: usize) {
        self.mix(number as u64);
    }

    fn write_isize(&mut self, number: isize) {
        self.mix(number.unsigned_abs() as u64);
    }

    fn finish(&self) -> u64 {
        // Tables use the low bits, which a product mixes least.
        self.0.rotate_left(26)
    }
}
