//! How new a state is.
//!
//! A state is the newer, the smaller the sets of facts are that no state had before of the same
//! worth: single facts, or pairs. What is new comes first, whatever an estimate says: so a search
//! leaves plateaus on which an estimate is blind.
//!
//! This is best-first width search (Lipovetzky & Geffner, AAAI 2017), in two forms. In BFWS(f₂) the
//! worth of a state is how many goals it lacks, and its estimate. In BFWS(f₅) it is how many goals
//! it lacks, and how much of a relaxed plan has been brought about on the way to it since that
//! number last fell; that needs no estimate, but for a relaxed plan where the number falls.

use super::super::compile::Compiled;
use super::super::formula::{Formula, Literal};
use super::super::hash::Map;
use super::super::state::State;

/// The facts seen so far, by the worth of states.
#[derive(Debug)]
pub(super) struct Novelty {
    looks_at_pairs: bool,
    /// For each worth, a bit for each fact, then one for each pair.
    seen: Map<(u32, u32), Vec<u64>>,
    holding: Vec<usize>,
    /// The effects of relaxed plans, of states in which a goal was reached.
    relaxed_plans: Vec<Vec<Literal>>,
}

/// Progress along the path to a state.
#[derive(Clone, Debug)]
pub(super) struct Progress {
    goals_left: u32,
    /// The relaxed plan of the last state in which a goal was reached.
    relaxed_plan: u32,
    /// Which of its literals were true since, a bit for each.
    reached: Vec<u64>,
}

impl Progress {
    /// Whether a successor that lacks so many goals has one more.
    pub(super) fn has_new_goal(&self, left: u32) -> bool {
        left < self.goals_left
    }

    /// An estimate of the memory it takes, in bytes.
    pub(super) fn size(&self) -> usize {
        size_of::<Self>() + 8 * self.reached.len()
    }
}

impl Novelty {
    pub(super) fn new(compiled: &Compiled) -> Self {
        Self {
            looks_at_pairs: compiled.facts.len() <= compiled.tuning.most_facts_for_novel_pairs,
            seen: Map::default(),
            holding: Vec::new(),
            relaxed_plans: Vec::new(),
        }
    }

    /// How far the way to a state has come, whose relaxed plan brings these literals about.
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
            reached: vec![0; subgoals.len().div_ceil(64)],
        }
    }

    fn relaxed_plan(&self, progress: &Progress) -> &[Literal] {
        &self.relaxed_plans[progress.relaxed_plan as usize]
    }

    /// The worth of a successor: how many goals it lacks, and how much of the relaxed plan has been
    /// reached.
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
        if self.seen.len() >= compiled.tuning.most_worths && !self.seen.contains_key(&worth) {
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
