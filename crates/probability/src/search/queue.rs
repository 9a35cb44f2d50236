//! Ranks of an end among the ends that an order still needs: [`Queue`].

use super::assignment;

/// Number of required action ends, and number of those that belong to running actions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Queue {
    pub(super) running: usize,
    pub(super) ends: usize,
}

impl Queue {
    /// Returns the number of happenings before the end at a rank, and the number after it, in two
    /// cases: starts come as late as possible, and all starts come first.
    pub(super) fn neighbours(self, rank: usize) -> [(usize, usize); 2] {
        let unstarted = self.ends - self.running.min(self.ends);
        let ends_after = self.ends - 1 - rank;
        let fewest = (rank + 1).saturating_sub(self.running);
        [
            (rank + fewest, ends_after + unstarted - fewest),
            (rank + unstarted, ends_after),
        ]
    }

    /// Returns the ranks to examine for an end. In a short queue these are all ranks. In a long
    /// queue, each end takes its best rank, so only the candidates for the best rank are returned.
    ///
    /// Probabilities decay, so shares are log-convex in the rank, except for the first happening
    /// and where ends begin to need starts. The best rank is at an end of one of these pieces.
    pub(super) fn ranks(self) -> Vec<usize> {
        if self.ends <= assignment::MAX_ROWS {
            return (0..self.ends).collect();
        }
        let bend = self.running;
        let pieces = [0, 1, 2, bend.saturating_sub(1), bend, bend + 1];
        let last = [self.ends - 2, self.ends - 1];
        let ranks = pieces.into_iter().chain(last);
        let mut ranks: Vec<usize> = ranks.filter(|rank| *rank < self.ends).collect();
        ranks.sort_unstable();
        ranks.dedup();
        ranks
    }
}

#[cfg(test)]
mod tests {
    use super::Queue;
    use crate::likelihoods::SpontaneousChange;
    use crate::search::chain::Chain;

    /// One of the examined ranks is the best of all, for any decay.
    #[test]
    fn long_queue_keeps_best_rank() {
        let mut seed: u32 = 3;
        let mut draw = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            f64::from(seed >> 8) / f64::from(1 << 24)
        };
        for turn in 0..400 {
            let queue = Queue {
                running: turn % 37,
                ends: 25 + turn % 41,
            };
            let mut chain = |truth| {
                let scale = if draw() < 0.5 { 0.01 } else { 0.5 };
                let flip = SpontaneousChange {
                    becomes_true: if draw() < 0.3 { 0.0 } else { scale * draw() },
                    becomes_false: if draw() < 0.3 { 0.0 } else { scale * draw() },
                };
                (Chain::of(flip, truth), draw())
            };
            let needs: Vec<(Chain, f64)> = (0..turn % 3).map(|_| chain(true)).collect();
            let brings: Vec<(Chain, f64)> = (0..turn % 2).map(|_| chain(false)).collect();
            let (throughout, chance) = chain(true);
            // For an over-all condition of an end: from the start just before it on.
            let lasting = |before: usize| match before.checked_sub(1) {
                Some(sooner) => throughout.best_after(chance, sooner) * (1.0 - throughout.fails()),
                None => chance,
            };
            let of = |chains: &[(Chain, f64)], steps: usize| {
                let chances = chains.iter().map(|(chain, p)| chain.best_after(*p, steps));
                chances.product::<f64>()
            };
            let share = |rank: usize| {
                let at =
                    |(before, after)| lasting(before) * of(&needs, before) * of(&brings, after);
                let [early, late] = queue.neighbours(rank);
                at(early).max(at(late))
            };
            let best = |ranks: Vec<usize>| ranks.into_iter().map(share).fold(0.0, f64::max);
            let (found, expected) = (best(queue.ranks()), best((0..queue.ends).collect()));
            assert!(
                found >= expected * (1.0 - 1e-13),
                "{queue:?}: {found} {expected}"
            );
        }
    }
}
