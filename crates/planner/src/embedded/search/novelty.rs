//! How new a state is.
//!
//! A state is the newer, the smaller the sets of facts are that no state had before of the same
//! worth: single facts, or pairs. What is new comes first, whatever the estimate says: so a search
//! leaves plateaus on which an estimate is blind (best-first width search; Lipovetzky & Geffner,
//! AAAI 2017).

use super::super::compile::Compiled;
use super::super::formula::Formula;
use super::super::hash::Map;
use super::super::state::State;

/// Beyond this many facts, pairs are not looked at.
const MOST_FACTS_FOR_PAIRS: usize = 1024;

/// No more worths than that are told apart.
const MOST_WORTHS: usize = 4096;

/// The facts seen so far, by the worth of states.
#[derive(Debug)]
pub(super) struct Novelty {
    looks_at_pairs: bool,
    /// For each worth, a bit for each fact, then one for each pair.
    seen: Map<(u32, u32), Vec<u64>>,
    holding: Vec<usize>,
}

impl Novelty {
    pub(super) fn new(compiled: &Compiled) -> Self {
        Self {
            looks_at_pairs: compiled.facts.len() <= MOST_FACTS_FOR_PAIRS,
            seen: Map::default(),
            holding: Vec::new(),
        }
    }

    /// 1 if the state has a fact that no state of that worth had before, 2 if it has such a pair,
    /// 3 otherwise; and how much memory it takes to remember that.
    pub(super) fn of(
        &mut self,
        compiled: &Compiled,
        state: &State,
        worth: (u32, u32),
    ) -> (i64, usize) {
        let count = compiled.facts.len();
        self.holding.clear();
        for fact in 0..count {
            if state.facts[fact / 64] >> (fact % 64) & 1 == 1 {
                self.holding.push(fact);
            }
        }
        if self.seen.len() >= MOST_WORTHS && !self.seen.contains_key(&worth) {
            return (3, 0);
        }
        let pairs = if self.looks_at_pairs {
            count * (count + 1) / 2
        } else {
            0
        };
        let size = (count + pairs).div_ceil(64);
        let mut memory = 0;
        let seen = self.seen.entry(worth).or_insert_with(|| {
            memory = 8 * size;
            vec![0; size]
        });
        let mut is_new = |bit: usize| {
            let (word, mask) = (&mut seen[bit / 64], 1 << (bit % 64));
            let is_new = *word & mask == 0;
            *word |= mask;
            is_new
        };
        let mut novelty = 3;
        for (place, &fact) in self.holding.iter().enumerate() {
            if is_new(fact) {
                novelty = 1;
            }
            if self.looks_at_pairs {
                let row = count + fact * (fact + 1) / 2;
                for &other in &self.holding[..place] {
                    if is_new(row + other) {
                        novelty = novelty.min(2);
                    }
                }
            }
        }
        (novelty, memory)
    }
}

/// How many conjuncts of the goal do not hold.
pub(super) fn goals_left(compiled: &Compiled, state: &State) -> u32 {
    let goal: &Formula = &compiled.goal;
    let literals = goal.literals.iter().filter(|l| !l.holds(&state.facts));
    let tests = goal
        .tests
        .iter()
        .filter(|&&test| !state.passes(compiled, test, None));
    let choices = goal.choices.iter().filter(|choice| {
        let mut passes = |test: u32| state.passes(compiled, test, None);
        !choice
            .iter()
            .any(|part| part.holds(&state.facts, &mut passes))
    });
    let left = literals.count() + tests.count() + choices.count();
    u32::try_from(left).unwrap_or(u32::MAX)
}
