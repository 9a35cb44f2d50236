//! The sequence of the C library's `rand()` without a seed.

use std::collections::VecDeque;

/// GNU's `rand()` with its initial seed 1: an additive feedback generator, o(i) = o(i − 3) + o(i −
/// 31) mod 2³², whose upper 31 bits are returned.
#[derive(Clone, Debug)]
pub(super) struct RandC {
    /// The last 31 numbers of the sequence.
    last: VecDeque<u32>,
}

const MODULUS: u64 = 2_147_483_647;

impl RandC {
    pub(super) fn with_default_seed() -> Self {
        let mut seeds = vec![1_u64];
        while seeds.len() < 31 {
            seeds.push(seeds[seeds.len() - 1] * 16_807 % MODULUS);
        }
        // The first three summands are those at 0, 1 and 2, because the state is read from 3 on.
        let low = |seed: &u64| u32::try_from(*seed).unwrap_or(u32::MAX);
        let mut last: VecDeque<u32> = seeds.iter().map(low).collect();
        // Numbers 31, 32 and 33 repeat numbers 0, 1 and 2.
        last.rotate_left(3);
        let mut generator = Self { last };
        for _ in 34..344 {
            generator.next();
        }
        generator
    }

    fn next(&mut self) -> u32 {
        let next = self.last[28].wrapping_add(self.last[0]);
        self.last.pop_front();
        self.last.push_back(next);
        next >> 1
    }

    /// Returns `rand() / RAND_MAX`, in [0, 1].
    pub(super) fn share(&mut self) -> f64 {
        f64::from(self.next()) / 2_147_483_647.0
    }
}

#[cfg(test)]
mod tests {
    use super::RandC;

    #[test]
    fn first_numbers_match_glibc() {
        let mut rand = RandC::with_default_seed();
        let numbers: Vec<u32> = (0..4).map(|_| rand.next()).collect();
        assert_eq!(
            numbers,
            [1_804_289_383, 846_930_886, 1_681_692_777, 1_714_636_915]
        );
    }
}
