//! Reference implementation of derivation: computes levels by relaxation, then applies all rules of
//! a level until nothing changes.

use std::collections::BTreeMap;

use crate::derivation::{GroundRule, Moment, holds};
use crate::ground::{Condition, Expression, FactId};
use crate::problem::Comparison;

/// Returns the number of negations below each derived fact; `None` if it is unbounded.
pub(super) fn levels(rules: &[GroundRule]) -> Option<BTreeMap<FactId, usize>> {
    let mut levels: BTreeMap<FactId, usize> = rules.iter().map(|rule| (rule.head, 0)).collect();
    loop {
        let mut has_changed = false;
        for rule in rules {
            let needed = needed(&rule.body, &levels, false);
            // Each level above 0 needs a fact on the level below it.
            if needed > levels.len() {
                return None;
            }
            if levels[&rule.head] < needed {
                levels.insert(rule.head, needed);
                has_changed = true;
            }
        }
        if !has_changed {
            return Some(levels);
        }
    }
}

fn needed(body: &Condition, levels: &BTreeMap<FactId, usize>, is_negated: bool) -> usize {
    match body {
        Condition::Fact(fact) => levels
            .get(fact)
            .map_or(0, |level| level + usize::from(is_negated)),
        Condition::Compare(..) => 0,
        Condition::Not(part) => needed(part, levels, !is_negated),
        Condition::And(parts) | Condition::Or(parts) => parts
            .iter()
            .map(|part| needed(part, levels, is_negated))
            .max()
            .unwrap_or(0),
    }
}

/// Returns the truth value of each derived fact; `None` if it depends on an undefined part.
pub(super) fn derive(
    rules: &[GroundRule],
    levels: &BTreeMap<FactId, usize>,
    basic: &dyn Moment<u32>,
) -> BTreeMap<FactId, Option<bool>> {
    let mut state = State {
        basic,
        truths: levels.keys().map(|&fact| (fact, Some(false))).collect(),
    };
    let top = levels.values().max().copied().unwrap_or(0);
    for level in 0..=top {
        for accepted in [Some(true), None] {
            let mut has_grown = true;
            while has_grown {
                has_grown = false;
                for rule in rules.iter().filter(|rule| levels[&rule.head] == level) {
                    let is_open = state.truths[&rule.head] == Some(false);
                    if is_open && holds(&rule.body, &state).ok() == accepted {
                        state.truths.insert(rule.head, accepted);
                        has_grown = true;
                    }
                }
            }
        }
    }
    state.truths
}

struct State<'a> {
    basic: &'a dyn Moment<u32>,
    truths: BTreeMap<FactId, Option<bool>>,
}

impl Moment<u32> for State<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, u32> {
        match self.truths.get(&fact) {
            Some(truth) => truth.ok_or(fact.0),
            None => self.basic.fact(fact),
        }
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, u32> {
        self.basic.compare(comparison, left, right)
    }
}
