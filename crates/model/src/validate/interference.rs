//! The no-moving-targets rule: minimum separation of interfering happenings.

use super::abort::Abort;
use super::judge::Judge;
use super::timeline::{Group, Happening, HappeningKind};
use super::violation::ViolationKind;
use crate::interference::Footprint;
use crate::task::Task;

/// Checks the happenings of the last group against each other and against preceding ones that are
/// close.
pub(super) fn check<'a>(judge: &Judge<'a>, groups: &[Group<'a>]) -> Result<(), Abort> {
    let Some((group, earlier)) = groups.split_last() else {
        return Ok(());
    };
    let touched = |group: &Group<'a>| {
        AccessIndex::from_footprints(group.happenings.iter().map(|own| &own.footprint))
    };
    let own = touched(group);
    for (position, second) in group.happenings.iter().enumerate() {
        let near = own.candidates(&second.footprint).into_iter();
        for first in near.take_while(|first| *first < position) {
            compare(judge, &group.happenings[first], second)?;
        }
    }
    if !judge.settings.needs_separation {
        return Ok(());
    }
    let separation = judge.task.epsilon();
    let latest = &group.happenings.last().expect("a group is not empty").time;
    for before in earlier.iter().rev() {
        // Earlier groups are further away, but may contain later happenings.
        let reach = &before.time + judge.settings.group_width() + separation;
        if reach <= group.time && reach <= *latest {
            break;
        }
        let own = touched(before);
        for second in &group.happenings {
            for first in own.candidates(&second.footprint) {
                let first = &before.happenings[first];
                if &second.time - &first.time < *separation {
                    compare(judge, first, second)?;
                }
            }
        }
    }
    Ok(())
}

/// Up to this number of happenings, all pairs are compared.
const FEW: usize = 16;

/// Kinds of access to a fact or a fluent.
const READS: usize = 0;
const ADDS: usize = 1;
const DELETES: usize = 2;
const READS_FLUENT: usize = 3;
const SHIFTS: usize = 4;
const ASSIGNS: usize = 5;

/// For each kind of access, the kinds that it interferes with.
const AGAINST: [&[usize]; 6] = [
    &[ADDS, DELETES],
    &[READS, DELETES],
    &[READS, ADDS],
    &[SHIFTS, ASSIGNS],
    &[READS_FLUENT, ASSIGNS],
    &[READS_FLUENT, SHIFTS, ASSIGNS],
];

/// Index of the facts and fluents that the happenings of a group access. Of thousands of
/// simultaneous happenings, most share nothing and need not be compared.
struct AccessIndex {
    count: usize,
    /// Sorted pairs of access, as numbered by [`place`], and position of the happening. `None` if
    /// there are few happenings.
    entries: Option<Vec<(usize, usize)>>,
}

impl AccessIndex {
    fn from_footprints<'a>(footprints: impl ExactSizeIterator<Item = &'a Footprint>) -> Self {
        let count = footprints.len();
        let by = (count > FEW).then(|| {
            let mut by = Vec::new();
            for (position, footprint) in footprints.enumerate() {
                let own = touches(footprint).into_iter();
                by.extend(own.map(|(id, how)| (place(id, how), position)));
            }
            by.sort_unstable();
            by
        });
        Self { count, entries: by }
    }

    /// Returns the happenings that may interfere with such a happening, sorted. It may contain
    /// others.
    fn candidates(&self, footprint: &Footprint) -> Vec<usize> {
        let Some(by) = &self.entries else {
            return (0..self.count).collect();
        };
        let mut near = Vec::new();
        for (id, how) in touches(footprint) {
            for other in AGAINST[how] {
                let place = place(id, *other);
                let first = by.partition_point(|(own, _)| *own < place);
                let those = by[first..].iter().take_while(|(own, _)| *own == place);
                near.extend(those.map(|(_, position)| *position));
            }
        }
        near.sort_unstable();
        near.dedup();
        near
    }
}

/// Returns the number of an access to a fact or a fluent.
fn place(id: u32, how: usize) -> usize {
    id as usize * AGAINST.len() + how
}

fn touches(footprint: &Footprint) -> Vec<(u32, usize)> {
    let mut touches = Vec::new();
    let facts = [&footprint.reads, &footprint.adds, &footprint.deletes];
    for (how, facts) in facts.into_iter().enumerate() {
        touches.extend(facts.iter().map(|fact| (fact.0, READS + how)));
    }
    let fluents = [
        &footprint.reads_fluents,
        &footprint.shifts,
        &footprint.assigns,
    ];
    for (how, fluents) in fluents.into_iter().enumerate() {
        touches.extend(fluents.iter().map(|fluent| (fluent.0, READS_FLUENT + how)));
    }
    touches
}

fn compare<'a>(
    judge: &Judge<'a>,
    first: &Happening<'a>,
    second: &Happening<'a>,
) -> Result<(), Abort> {
    // Times of timed initials are not a mistake of the plan.
    let are_both_timed = matches!(
        (first.kind, second.kind),
        (HappeningKind::Timed(_), HappeningKind::Timed(_))
    );
    let interfere = first.footprint.interferes_with(&second.footprint);
    if are_both_timed || !interfere || judge.settings.allows_simultaneous_reads {
        return Ok(());
    }
    // The later happening is reported, unless it does not belong to the plan.
    let blamed = second.kind.step().or(first.kind.step());
    let mistake = ViolationKind::Interference {
        first: judge.occurrence(first.kind, &first.time),
        second: judge.occurrence(second.kind, &second.time),
        over: over(judge.task, &first.footprint, &second.footprint),
        separation: (judge.settings.needs_separation).then(|| judge.task.epsilon().clone()),
    };
    Err(judge.violation(&second.time, blamed, mistake))
}

/// Returns the first fact or fluent over which two footprints interfere.
pub(super) fn over(task: &Task, a: &Footprint, b: &Footprint) -> String {
    for (writer, other) in [(a, b), (b, a)] {
        let facts = writer
            .adds
            .iter()
            .filter(|fact| other.reads.contains(fact) || other.deletes.contains(fact))
            .chain(
                writer
                    .deletes
                    .iter()
                    .filter(|fact| other.reads.contains(fact)),
            );
        if let Some(fact) = facts.min() {
            return task.fact_name(*fact);
        }
        let fluents = writer
            .shifts
            .iter()
            .filter(|fluent| other.reads_fluents.contains(fluent))
            .chain(writer.assigns.iter().filter(|fluent| {
                other.reads_fluents.contains(fluent)
                    || other.assigns.contains(fluent)
                    || other.shifts.contains(fluent)
            }));
        if let Some(fluent) = fluents.min() {
            return task.fluent_name(*fluent);
        }
    }
    "nothing".to_owned()
}

#[cfg(test)]
mod tests {
    use proptest::collection::{btree_set, vec};
    use proptest::prelude::*;

    use super::*;
    use crate::ground::{FactId, FluentId};

    fn footprint() -> impl Strategy<Value = Footprint> {
        let facts = || btree_set((0..40_u32).prop_map(FactId), 0..3);
        let fluents = || btree_set((0..40_u32).prop_map(FluentId), 0..2);
        let sets = (facts(), facts(), facts(), fluents(), fluents(), fluents());
        sets.prop_map(
            |(reads, adds, deletes, reads_fluents, shifts, assigns)| Footprint {
                reads,
                adds,
                deletes,
                reads_fluents,
                shifts,
                assigns,
            },
        )
    }

    proptest! {
        #[test]
        fn index_returns_all_interfering_happenings(
            all in vec(footprint(), FEW + 1..60),
            one in footprint(),
        ) {
            let interfering = all.iter().enumerate().filter(|(_, other)| other.interferes_with(&one));
            let interfering: Vec<usize> = interfering.map(|(position, _)| position).collect();
            prop_assert_eq!(AccessIndex::from_footprints(all.iter()).candidates(&one), interfering);
            let few = AccessIndex::from_footprints(all[..FEW].iter()).candidates(&one);
            prop_assert_eq!(few, (0..FEW).collect::<Vec<_>>());
        }
    }
}
