//! Novelty of states.
//!
//! A state is more novel, the smaller the sets of facts are that no earlier state of the same worth
//! contained: single facts, or pairs. Novel states come first, regardless of their estimate. So a
//! search leaves plateaus of the estimate.
//!
//! This is best-first width search (Lipovetzky & Geffner, AAAI 2017). In BFWS(f₅), the worth of a
//! state is its number of unachieved goals, and the number of facts of a relaxed plan that were
//! achieved since this number last decreased. That needs no estimate, except for a relaxed plan
//! where the number decreases. Where the goal is serialized, the worth is the estimate.

use super::super::compile::Compiled;
use super::super::formula::Literal;
use super::super::hash::Map;
use super::super::state::State;

/// The facts seen so far, by the worth of states.
#[derive(Debug)]
pub(super) struct Novelty {
    includes_pairs: bool,
    /// For each worth, a bit for each fact; then for each fact a bit for each fact up to it, in
    /// separate words.
    seen: Map<(u32, u32), Vec<u64>>,
    /// Number of words of these that were read.
    words: u64,
    /// The effects of the relaxed plans of states that reached a goal.
    relaxed_plans: Vec<Vec<Literal>>,
}

/// Progress along the path to a state.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Progress {
    goals_left: u32,
    /// Number of the relaxed plan of the last state that reached a goal.
    relaxed_plan: u32,
    /// The literals of that plan that were true since, as a bit set.
    reached: Box<[u64]>,
}

impl Progress {
    /// Returns `true` if a successor with `left` remaining goals has reached one more goal.
    pub(super) fn has_new_goal(&self, left: u32) -> bool {
        left < self.goals_left
    }

    /// Returns an estimate of the memory, in bytes.
    pub(super) fn size(&self) -> usize {
        size_of::<Self>() + 8 * self.reached.len()
    }
}

impl Novelty {
    pub(super) fn new(compiled: &Compiled) -> Self {
        Self {
            includes_pairs: compiled.facts.len() <= compiled.tuning.most_facts_for_novel_pairs,
            seen: Map::default(),
            words: 0,
            relaxed_plans: Vec::new(),
        }
    }

    /// Returns the progress on the path to a state, whose relaxed plan achieves the literals
    /// `subgoals`.
    pub(super) fn progress(
        &mut self,
        state: &State,
        goals_left: u32,
        before: Option<&Progress>,
        subgoals: &[Literal],
    ) -> Progress {
        if let Some(before) = before.filter(|before| goals_left >= before.goals_left) {
            let mut progress = before.clone();
            progress.goals_left = goals_left;
            for (number, literal) in self.relaxed_plan(before).iter().enumerate() {
                if literal.holds(&state.facts) {
                    progress.reached[number / 64] |= 1 << (number % 64);
                }
            }
            return progress;
        }
        self.relaxed_plans.push(subgoals.to_vec());
        Progress {
            goals_left,
            relaxed_plan: u32::try_from(self.relaxed_plans.len() - 1).unwrap_or(u32::MAX),
            reached: vec![0; subgoals.len().div_ceil(64)].into(),
        }
    }

    /// Forgets the facts seen.
    pub(super) fn forget(&mut self) {
        self.seen.values_mut().for_each(|seen| seen.fill(0));
    }

    fn relaxed_plan(&self, progress: &Progress) -> &[Literal] {
        &self.relaxed_plans[progress.relaxed_plan as usize]
    }

    /// Returns the worth of a successor: the number of remaining goals, and the number of achieved
    /// literals of the relaxed plan.
    pub(super) fn worth(&self, state: &State, left: u32, before: &Progress) -> (u32, u32) {
        if left < before.goals_left {
            return (left, 0);
        }
        let literals = self.relaxed_plan(before).iter().enumerate();
        let reached = literals.filter(|(number, literal)| {
            before.reached[number / 64] >> (number % 64) & 1 == 1 || literal.holds(&state.facts)
        });
        (left, u32::try_from(reached.count()).unwrap_or(u32::MAX))
    }

    /// Returns 1 if the state has a fact that no earlier state of that worth had, 2 if it has such
    /// a pair, 3 otherwise. Also returns the additional memory.
    pub(super) fn of(
        &mut self,
        compiled: &Compiled,
        state: &State,
        worth: (u32, u32),
    ) -> (i64, usize) {
        if self.seen.len() >= compiled.tuning.most_worths && !self.seen.contains_key(&worth) {
            return (3, 0);
        }
        let singles = state.facts.len();
        let pairs = if self.includes_pairs {
            row(compiled.facts.len())
        } else {
            0
        };
        let size = singles + pairs;
        let mut memory = 0;
        let seen = self.seen.entry(worth).or_insert_with(|| {
            memory = 8 * size;
            vec![0; size]
        });
        let (novelty, words) = newness(seen, &state.facts, self.includes_pairs);
        self.words += words;
        (novelty, memory)
    }

    /// Returns the number of words of known facts and pairs that were read.
    pub(super) fn words(&self) -> u64 {
        self.words
    }
}

/// Adds facts to those seen, in the layout of [`Novelty::seen`]. Returns 1 if a fact is new, 2 if only a pair is, 3
/// otherwise; and the number of words that were read.
fn newness(seen: &mut [u64], facts: &[u64], looks_at_pairs: bool) -> (i64, u64) {
    let (seen_facts, seen_pairs) = seen.split_at_mut(facts.len());
    let mut words = facts.len();
    let mut novelty = if remember(seen_facts, facts) { 1 } else { 3 };
    if looks_at_pairs {
        for fact in bits(facts) {
            let others = &mut seen_pairs[row(fact)..row(fact + 1)];
            words += others.len();
            if remember(others, facts) {
                novelty = novelty.min(2);
            }
        }
    }
    (novelty, words as u64)
}

/// Returns the number of words for the pairs of the facts before this one.
///
/// A fact has one word for each 64 facts up to it. Its last word may contain a pair for a second
/// time, which is new exactly if it is new in the other position.
fn row(fact: usize) -> usize {
    let (whole, rest) = (fact / 64, fact % 64);
    64 * (whole * (whole + 1) / 2) + rest * (whole + 1)
}

/// Returns the positions of the set bits.
fn bits(words: &[u64]) -> impl Iterator<Item = usize> + '_ {
    words.iter().enumerate().flat_map(|(place, &word)| {
        let mut left = word;
        std::iter::from_fn(move || {
            let bit = (left != 0).then(|| left.trailing_zeros() as usize)?;
            left &= left - 1;
            Some(64 * place + bit)
        })
    })
}

/// Adds facts to those seen. Returns `true` if one is new. `seen` may have fewer words.
fn remember(seen: &mut [u64], facts: &[u64]) -> bool {
    let mut is_new = false;
    for (seen, facts) in seen.iter_mut().zip(facts) {
        is_new |= facts & !*seen != 0;
        *seen |= facts;
    }
    is_new
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    /// Sets of facts and of pairs, as in the definition.
    #[derive(Default)]
    struct ReferenceNovelty {
        facts: BTreeSet<usize>,
        pairs: BTreeSet<(usize, usize)>,
    }

    impl ReferenceNovelty {
        fn newness(&mut self, facts: &BTreeSet<usize>) -> i64 {
            let mut novelty = 3;
            for &one in facts {
                for &other in facts.range(one + 1..) {
                    if self.pairs.insert((one, other)) {
                        novelty = 2;
                    }
                }
            }
            for &fact in facts {
                if self.facts.insert(fact) {
                    novelty = 1;
                }
            }
            novelty
        }
    }

    #[test]
    fn novelty_agrees_with_sets_of_facts_and_pairs() {
        let mut counts = [0; 3];
        for count in [1, 5, 63, 64, 65, 150, 200] {
            let singles = usize::div_ceil(count, 64);
            let mut seen = vec![0; singles + row(count)];
            let mut twin = ReferenceNovelty::default();
            let mut random = 1_u64;
            for _ in 0..300 {
                let mut facts = BTreeSet::new();
                let mut words = vec![0_u64; singles];
                for _ in 0..6 {
                    random = random
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    let fact = usize::try_from(random >> 33).expect("31 bits") % count;
                    facts.insert(fact);
                    words[fact / 64] |= 1 << (fact % 64);
                }
                let expected = twin.newness(&facts);
                assert_eq!(
                    newness(&mut seen, &words, true).0,
                    expected,
                    "{count}: {facts:?}"
                );
                counts[usize::try_from(expected - 1).expect("1 to 3")] += 1;
            }
        }
        assert!(counts.iter().all(|count| *count > 50), "{counts:?}");
    }
}
