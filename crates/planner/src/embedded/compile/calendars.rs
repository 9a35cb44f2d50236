//! Calendars: literals and numeric tests that only timed initials change, such as opening hours and
//! the depth of water.
//!
//! Conditions on them restrict the times of happenings, not the states. They are removed from the
//! conditions. Each happening stores the [windows](Windows) of its calendars. The search does not branch over their timed initials.

use std::collections::{BTreeMap, BTreeSet};

use super::{Action, Snap};
use crate::embedded::formula::{Formula, Literal};
use crate::embedded::time::{NEVER, Ticks};
use crate::embedded::windows::{Interval, Windows, intersection};

/// A literal or a numeric test that only timed initials change.
#[derive(Clone, Debug)]
pub(crate) struct Calendar {
    /// `None` for a numeric test.
    pub(crate) literal: Option<Literal>,
    /// The intervals while it holds.
    pub(crate) spans: Vec<Interval>,
}

/// Conditions on calendars.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Dates {
    /// Positions in [`Compiled::calendars`](super::Compiled::calendars).
    pub(crate) calendars: Vec<u32>,
    /// The common windows of all of them; `None` if there are no calendars.
    pub(crate) windows: Option<u32>,
}

/// A fact or a numeric test, by number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Dated {
    Fact(u32),
    Test(u32),
}

/// A condition whose truth changes at fixed times only.
pub(super) struct DatedCondition {
    pub(super) dated: Dated,
    pub(super) is_true_first: bool,
    /// Its changes in order of time; each time is rounded down and rounded up.
    pub(super) changes: Vec<(Ticks, Ticks, bool)>,
}

impl DatedCondition {
    /// Returns the intervals in which the literal holds.
    pub(super) fn spans(&self, truth: bool) -> Vec<Interval> {
        spans(self.is_true_first == truth, truth, &self.changes)
    }

    /// Returns the times at which a happening may read the literal as true: no timed initial that
    /// writes the fact or a fluent of the test, even without a change, is closer than `epsilon`.
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

/// Removes these conditions from happenings and actions, and records their windows. Returns the
/// calendars that the conditions use.
pub(super) fn extract_conditions(
    conditions: &[DatedCondition],
    epsilon: Ticks,
    actions: &mut [Action],
    snaps: &mut [Snap],
) -> (Vec<Calendar>, Windows) {
    let dated = conditions.iter().zip(0..);
    let mut extraction = Extraction {
        conditions,
        places: dated
            .map(|(condition, place)| (condition.dated, place))
            .collect(),
        epsilon,
        numbers: BTreeMap::new(),
        calendars: Vec::new(),
        windows: Windows::default(),
    };
    for snap in snaps {
        snap.dates = extraction.take(&mut snap.condition, false);
    }
    for action in actions {
        action.dates = extraction.take(&mut action.over_all, true);
    }
    (extraction.calendars, extraction.windows)
}

/// The calendars and windows extracted so far.
struct Extraction<'a> {
    conditions: &'a [DatedCondition],
    places: BTreeMap<Dated, usize>,
    epsilon: Ticks,
    /// The number of the calendar of each condition with a required truth.
    numbers: BTreeMap<(usize, bool), u32>,
    calendars: Vec<Calendar>,
    windows: Windows,
}

impl Extraction<'_> {
    /// Removes the conjuncts on calendars from a condition.
    fn take(&mut self, formula: &mut Formula, is_throughout: bool) -> Dates {
        let mut taken = Vec::new();
        let places = &self.places;
        let mut is_kept = |dated: Dated, truth: bool| {
            let place = places.get(&dated);
            taken.extend(place.map(|&place| (place, truth)));
            place.is_none()
        };
        formula
            .literals
            .retain(|literal| is_kept(Dated::Fact(literal.fact()), literal.truth()));
        formula
            .tests
            .retain(|&test| is_kept(Dated::Test(test), true));
        if taken.is_empty() {
            return Dates::default();
        }
        let lists = taken.iter().map(|&(place, truth)| {
            let condition = &self.conditions[place];
            if is_throughout {
                condition.spans(truth)
            } else {
                condition.reading_times(truth, self.epsilon)
            }
        });
        let list = lists.reduce(|left, right| intersection(&left, &right));
        Dates {
            windows: Some(self.windows.number(list.unwrap_or_default())),
            calendars: taken.into_iter().map(|taken| self.number(taken)).collect(),
        }
    }

    /// Returns the number of the calendar of a condition.
    fn number(&mut self, (place, truth): (usize, bool)) -> u32 {
        let next = u32::try_from(self.calendars.len()).expect("fewer than 2^32 calendars");
        let number = *self.numbers.entry((place, truth)).or_insert(next);
        if number == next {
            let condition = &self.conditions[place];
            self.calendars.push(Calendar {
                literal: match condition.dated {
                    Dated::Fact(fact) => Some(Literal::new(fact, truth)),
                    Dated::Test(_) => None,
                },
                spans: condition.spans(truth),
            });
        }
        number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dated() -> DatedCondition {
        DatedCondition {
            dated: Dated::Fact(0),
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
