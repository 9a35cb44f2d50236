//! Calendars: literals that only timed initials change, such as opening hours.
//!
//! Conditions on them restrict the times of happenings, not the states. They are removed from the
//! conditions, and each happening stores the [windows](Windows) in which all of its calendar
//! literals hold. The search does not branch over their timed initials.

use std::collections::BTreeSet;

use super::{Action, Snap};
use crate::embedded::formula::{Formula, Literal};
use crate::embedded::time::{NEVER, Ticks};
use crate::embedded::windows::{Interval, Windows, intersection};

/// A literal that only timed initials change.
#[derive(Clone, Debug)]
pub(crate) struct Calendar {
    pub(crate) literal: Literal,
    /// The intervals while it holds.
    pub(crate) spans: Vec<Interval>,
}

/// Conditions on calendars.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Dates {
    pub(crate) literals: Vec<Literal>,
    /// The windows in which all of them hold; `None` if there are no literals.
    pub(crate) windows: Option<u32>,
}

/// A fact that changes at fixed times only.
pub(super) struct DatedFact {
    pub(super) fact: u32,
    pub(super) is_true_first: bool,
    /// Its changes in order of time; each time is rounded down and rounded up.
    pub(super) changes: Vec<(Ticks, Ticks, bool)>,
}

impl DatedFact {
    /// Returns the intervals in which the literal holds.
    pub(super) fn spans(&self, truth: bool) -> Vec<Interval> {
        spans(self.is_true_first == truth, truth, &self.changes)
    }

    /// Returns the times at which a happening may read the literal as true: no timed initial that
    /// writes the fact, even without a change, is closer than `epsilon`.
    fn reading_times(&self, truth: bool, epsilon: Ticks) -> Vec<Interval> {
        let mut times = Vec::new();
        let mut begin = -NEVER;
        let mut is_true = self.is_true_first;
        for &(down, up, truth_after) in &self.changes {
            if is_true == truth && begin <= down - epsilon {
                times.push((begin, down - epsilon));
            }
            begin = up + epsilon;
            is_true = truth_after;
        }
        if is_true == truth {
            times.push((begin, NEVER));
        }
        times
    }
}

/// Returns the intervals in which a literal of that truth holds, given the changes of its fact. The
/// times of the changes are rounded down and up; the intervals are rounded to the inside.
pub(crate) fn spans(
    holds_first: bool,
    truth: bool,
    changes: &[(Ticks, Ticks, bool)],
) -> Vec<Interval> {
    let mut spans = Vec::new();
    let mut since = holds_first.then_some(-NEVER);
    for &(down, up, is_true) in changes {
        match (since, is_true == truth) {
            (None, true) => since = Some(up),
            (Some(begin), false) => {
                spans.push((begin, down));
                since = None;
            }
            _ => {}
        }
    }
    spans.extend(since.map(|begin| (begin, NEVER)));
    spans
}

/// Returns the facts that are read other than as conjuncts of conditions of actions.
pub(super) fn nested_reads<'a>(
    actions: &[Action],
    snaps: &[Snap],
    others: impl Iterator<Item = &'a Formula>,
) -> BTreeSet<u32> {
    let mut nested = BTreeSet::new();
    let mut visit = |formula: &Formula| {
        formula.visit_literals(&mut |literal| {
            nested.insert(literal.fact());
        });
    };
    others.for_each(&mut visit);
    actions
        .iter()
        .flat_map(|action| &action.guards)
        .for_each(&mut visit);
    for snap in snaps {
        snap.conditional
            .iter()
            .for_each(|effect| visit(&effect.now));
    }
    let conditions = snaps.iter().map(|snap| &snap.condition);
    for condition in conditions.chain(actions.iter().map(|action| &action.over_all)) {
        condition.choices.iter().flatten().for_each(&mut visit);
    }
    nested
}

/// Removes the conditions on these facts from happenings and actions, and records their windows.
/// Returns the calendars used by the conditions.
pub(super) fn extract_conditions(
    facts: &[DatedFact],
    epsilon: Ticks,
    actions: &mut [Action],
    snaps: &mut [Snap],
) -> (Vec<Calendar>, Windows) {
    let mut windows = Windows::default();
    let mut literals = BTreeSet::new();
    let mut take = |formula: &mut Formula, is_throughout: bool| {
        let of = |literal: &Literal| facts.iter().find(|dated| dated.fact == literal.fact());
        let taken: Vec<Literal> = formula
            .literals
            .iter()
            .copied()
            .filter(|literal| of(literal).is_some())
            .collect();
        if taken.is_empty() {
            return Dates::default();
        }
        formula.literals.retain(|literal| of(literal).is_none());
        literals.extend(taken.iter().copied());
        let lists = taken.iter().filter_map(|literal| {
            let dated = of(literal)?;
            Some(if is_throughout {
                dated.spans(literal.truth())
            } else {
                dated.reading_times(literal.truth(), epsilon)
            })
        });
        let list = lists.reduce(|left, right| intersection(&left, &right));
        Dates {
            literals: taken,
            windows: Some(windows.number(list.unwrap_or_default())),
        }
    };
    for snap in snaps {
        snap.dates = take(&mut snap.condition, false);
    }
    for action in actions {
        action.dates = take(&mut action.over_all, true);
    }
    let calendars = literals.into_iter().filter_map(|literal| {
        let dated = facts.iter().find(|dated| dated.fact == literal.fact())?;
        Some(Calendar {
            literal,
            spans: dated.spans(literal.truth()),
        })
    });
    (calendars.collect(), windows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dated() -> DatedFact {
        DatedFact {
            fact: 0,
            is_true_first: false,
            changes: vec![
                (10, 10, true),
                (20, 20, true),
                (30, 30, false),
                (31, 31, true),
            ],
        }
    }

    #[test]
    fn literal_holds_between_its_changes() {
        assert_eq!(dated().spans(true), [(10, 30), (31, NEVER)]);
        assert_eq!(dated().spans(false), [(-NEVER, 10), (30, 31)]);
    }

    #[test]
    fn readers_are_separated_from_timed_initials_of_the_fact() {
        let times = dated().reading_times(true, 1);
        assert_eq!(times, [(11, 19), (21, 29), (32, NEVER)]);
        assert_eq!(dated().reading_times(false, 1), [(-NEVER, 9)]);
    }
}
