//! Comparisons of the goal that timed initials alone decide.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::ground::{Change, Condition, Expression, FluentId};
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{Situation, Task};
use elbowroom_num::Rational;

use super::compile::visit_changes;

/// Returns the conjuncts of the goal that compare numbers which no action changes, and that are false after all
/// timed initials.
pub(super) fn false_comparisons<'a>(
    task: &Task,
    grounding: &'a Grounding,
    situation: &Situation,
) -> Vec<&'a Condition> {
    let mut comparisons = grounding.goal.conjuncts();
    comparisons.retain(|conjunct| matches!(conjunct, Condition::Compare(..)));
    if comparisons.is_empty() {
        return comparisons;
    }
    let mut changed = BTreeSet::new();
    let running = situation.running.iter().map(|running| &*running.action);
    for action in running.chain(&grounding.actions) {
        visit_changes(action, &mut |fluent, _| {
            changed.insert(fluent);
        });
    }
    let mut last = BTreeMap::new();
    let future = task.timed().iter();
    let future = future.filter(|timed| timed.time > situation.time);
    for change in future.flat_map(|timed| &timed.changes) {
        if let Change::Update { fluent, value, .. } = change {
            last.insert(*fluent, value);
        }
    }
    let value = |fluent: FluentId| -> Option<Rational> {
        match last.get(&fluent) {
            Some(Expression::Constant(value)) => Some(value.clone()),
            Some(_) => None,
            None => situation.state.values.get(&fluent).cloned(),
        }
    };
    comparisons.retain(|conjunct| {
        let Condition::Compare(comparison, left, right) = conjunct else {
            return false;
        };
        let sides = [left, right].map(|side| {
            side.evaluate(&mut |leaf| match leaf {
                Expression::Fluent(fluent) if !changed.contains(fluent) => value(*fluent),
                _ => None,
            })
        });
        matches!(sides, [Some(left), Some(right)] if !comparison.holds(&left, &right))
    });
    comparisons
}
