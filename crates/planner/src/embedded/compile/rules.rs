//! Derived facts by strata.

use elbowroom_model::Task;

use super::Rule;
use super::symbols::Symbols;

/// Returns the rules by strata, and the heads of each stratum.
pub(super) fn stratified(
    rules: Vec<Rule>,
    task: &Task,
    symbols: &Symbols,
) -> (Vec<Vec<Rule>>, Vec<Vec<u32>>) {
    if rules.is_empty() {
        return (Vec::new(), Vec::new());
    }
    let mut level = vec![0_usize; symbols.facts.len()];
    let is_derived: Vec<bool> = symbols.facts.iter().map(|&f| task.is_derived(f)).collect();
    // The number of rounds is at most the number of derived facts, since the task has ensured that
    // none depends on its own negation.
    for _ in 0..=rules.len() {
        let mut changed = false;
        for rule in &rules {
            let mut needed = level[rule.head as usize];
            rule.body.visit_literals(&mut |literal| {
                let fact = literal.fact() as usize;
                if is_derived[fact] {
                    needed = needed.max(level[fact] + usize::from(!literal.truth()));
                }
            });
            if needed > level[rule.head as usize] {
                level[rule.head as usize] = needed;
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    let count = level.iter().max().copied().unwrap_or(0) + 1;
    let mut strata = vec![Vec::new(); count];
    let mut derived = vec![Vec::new(); count];
    for (fact, _) in is_derived
        .iter()
        .enumerate()
        .filter(|(_, derived)| **derived)
    {
        derived[level[fact]].push(narrow(fact));
    }
    for rule in rules {
        strata[level[rule.head as usize]].push(rule);
    }
    (strata, derived)
}

fn narrow(number: usize) -> u32 {
    u32::try_from(number).expect("fewer than 2^32 entries")
}
