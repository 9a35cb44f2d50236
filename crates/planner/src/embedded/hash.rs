//! Tables with a fast hash whose result does not depend on the run.

use std::hash::{BuildHasherDefault, Hasher};

use indexmap::IndexMap;

/// A map in order of insertion.
pub(crate) type Map<K, V> = IndexMap<K, V, BuildHasherDefault<Mixer>>;

/// Multiplies and rotates, as the hash of the Firefox and rustc code bases does. The keys come
/// from one problem; collision attacks are not a concern.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Mixer(u64);

const FACTOR: u64 = 0x517c_c1b7_2722_0a95;

impl Hasher for Mixer {
    fn write(&mut self, bytes: &[u8]) {
        for chunk in bytes.chunks(8) {
            let mut word = [0; 8];
            word[..chunk.len()].copy_from_slice(chunk);
            self.write_u64(u64::from_le_bytes(word));
        }
    }

    fn write_u8(&mut self, value: u8) {
        self.write_u64(u64::from(value));
    }

    fn write_u32(&mut self, value: u32) {
        self.write_u64(u64::from(value));
    }

    fn write_u64(&mut self, value: u64) {
        self.0 = (self.0.rotate_left(5) ^ value).wrapping_mul(FACTOR);
    }

    fn write_usize(&mut self, value: usize) {
        self.write_u64(value as u64);
    }

    fn finish(&self) -> u64 {
        // The last multiplication leaves the low bits poor, and tables use them.
        self.0 ^ (self.0 >> 32)
    }
}
