//! Numbers that only timed initials change.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Change, Expression, FluentId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::initial_state::InitialState;
use super::static_facts::{Span, StaticFacts};

/// Values of fluents that are assigned by timed initials, by fluent and in the order of time.
#[derive(Debug, Default)]
pub(super) struct TimedNumbers {
    now: Rational,
    values: BTreeMap<FluentId, Vec<(Rational, Rational)>>,
    /// Fluents that get different values at the same time.
    ambiguous: BTreeSet<FluentId>,
}

impl TimedNumbers {
    pub(super) fn of(beginning: &InitialState) -> Self {
        let mut numbers = Self {
            now: beginning.now.clone(),
            ..Self::default()
        };
        for happening in &beginning.timed {
            for change in &happening.changes {
                let Change::Update { fluent, value, .. } = change else {
                    continue;
                };
                let values = numbers.values.entry(*fluent).or_default();
                let is_repeated = values.last().is_some_and(|last| last.0 == happening.time);
                match value {
                    Expression::Constant(value) if !is_repeated => {
                        values.push((happening.time.clone(), value.clone()));
                    }
                    _ => {
                        numbers.ambiguous.insert(*fluent);
                    }
                }
            }
        }
        numbers
    }

    /// Returns the value of a fluent after the timed initials up to `since`; `None`: before all of them.
    fn value(&self, task: &Task, fluent: FluentId, since: Option<&Rational>) -> Option<Rational> {
        let values = self.values.get(&fluent).map_or(&[][..], Vec::as_slice);
        let past = values.partition_point(|value| Some(&value.0) <= since);
        let initial = task.initial().values.get(&fluent);
        let latest = past.checked_sub(1).map(|last| &values[last].1);
        latest.or(initial).cloned()
    }
}

impl StaticFacts {
    /// Returns the closed intervals in which a comparison may be true, or false if `truth` is. Returns `None` if it
    /// reads a number that something other than timed initials changes: it may then be true or false at any time.
    pub(super) fn spans_of_comparison(
        &self,
        task: &Task,
        (comparison, sides): (Comparison, [&Expression; 2]),
        truth: bool,
    ) -> Option<Vec<Span>> {
        let mut is_determined = true;
        let mut times = BTreeSet::new();
        for side in sides {
            side.visit_leaves(&mut |leaf| match leaf {
                Expression::Fluent(fluent) => {
                    is_determined &= !self.is_changed_by_actions(task.function_of(*fluent))
                        && !self.numbers.ambiguous.contains(fluent);
                    let values = self.numbers.values.get(fluent);
                    times.extend(values.into_iter().flatten().map(|value| &value.0));
                }
                Expression::Constant(_) => {}
                _ => is_determined = false,
            });
        }
        if !is_determined {
            return None;
        }
        let holds = |since: Option<&Rational>| {
            let [left, right] = sides.map(|side| {
                side.evaluate(&mut |leaf| match leaf {
                    Expression::Fluent(fluent) => self.numbers.value(task, *fluent, since),
                    _ => None,
                })
            });
            match (left, right) {
                (Some(left), Some(right)) => comparison.holds(&left, &right) == truth,
                _ => self.assumes_values || !truth,
            }
        };
        let mut spans: Vec<Span> = Vec::new();
        for since in std::iter::once(None).chain(times.into_iter().map(Some)) {
            let time = since.unwrap_or(&self.numbers.now);
            let open = spans.last_mut().filter(|span| span.1.is_none());
            match (open, holds(since)) {
                (None, true) => spans.push((time.clone(), None)),
                (Some(span), false) => span.1 = Some(time.clone()),
                _ => {}
            }
        }
        Some(spans)
    }
}
