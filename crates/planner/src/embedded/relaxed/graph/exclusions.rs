//! Operators that a running action excludes for good.

use super::super::super::compile::{Compiled, NONE};
use super::super::super::formula::Literal;
use super::Graph;

impl Graph {
    /// Returns for each action the operators that are applicable neither while it is running,
    /// because they contradict its over-all condition, nor afterwards, because its end permanently
    /// destroys one of their preconditions. So a dead end is detected at the start of the action:
    /// for example, if a bottle is packed that must still be filled.
    pub(super) fn find_excluded_operators(&self, compiled: &Compiled) -> Vec<Vec<u32>> {
        let mut is_achieved = vec![false; self.proposition_count];
        for &effect in &self.effects {
            is_achieved[effect as usize] = true;
        }
        let needing = |literal: Literal| {
            let operators = self.dependents(literal.0);
            self.needing_list[operators].iter().copied()
        };
        let kept_out = compiled.actions.iter().map(|action| {
            if action.end == NONE || action.over_all.literals.is_empty() {
                return Vec::new();
            }
            let end = compiled.snap(action.end);
            let adds = end.adds.iter().map(|&fact| Literal::new(fact, false));
            let deletes = end.deletes.iter().map(|&fact| Literal::new(fact, true));
            let lost = adds
                .chain(deletes)
                .filter(|lost| !is_achieved[lost.index()]);
            let mut after: Vec<u32> = lost.flat_map(needing).collect();
            after.sort_unstable();
            let over_all = action.over_all.literals.iter();
            let broken = over_all.map(|held| Literal::new(held.fact(), !held.truth()));
            let mut kept_out: Vec<u32> = broken
                .flat_map(needing)
                .filter(|operator| after.binary_search(operator).is_ok())
                .collect();
            kept_out.sort_unstable();
            kept_out.dedup();
            kept_out
        });
        kept_out.collect()
    }
}
