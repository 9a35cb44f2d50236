//! The no-moving-targets rule: interfering happenings keep their distance.

use super::judge::Judge;
use super::stop::Stop;
use super::timeline::{Group, Happening, What};
use super::violation::Mistake;
use crate::interference::Footprint;
use crate::task::Task;

/// Checks the happenings of the last group against each other and against those shortly before.
pub(super) fn check<'a>(judge: &Judge<'a>, groups: &[Group<'a>]) -> Result<(), Stop> {
    let Some((group, earlier)) = groups.split_last() else {
        return Ok(());
    };
    for (position, second) in group.happenings.iter().enumerate() {
        for first in &group.happenings[..position] {
            compare(judge, first, second)?;
        }
    }
    if !judge.settings.needs_separation {
        return Ok(());
    }
    let separation = judge.task.epsilon();
    let latest = &group.happenings.last().expect("a group is not empty").time;
    for before in earlier.iter().rev() {
        // Earlier groups are further away still, but their own happenings may be later.
        let reach = &before.time + judge.settings.group_width() + separation;
        if reach <= group.time && reach <= *latest {
            break;
        }
        for second in &group.happenings {
            for first in &before.happenings {
                if &second.time - &first.time < *separation {
                    compare(judge, first, second)?;
                }
            }
        }
    }
    Ok(())
}

fn compare<'a>(
    judge: &Judge<'a>,
    first: &Happening<'a>,
    second: &Happening<'a>,
) -> Result<(), Stop> {
    // The plan is not to blame for when timed initials happen.
    let are_both_timed = matches!((first.what, second.what), (What::Timed(_), What::Timed(_)));
    let interfere = if judge.settings.allows_simultaneous_reads {
        first.footprint.overwrites(&second.footprint)
    } else {
        first.footprint.interferes_with(&second.footprint)
    };
    if are_both_timed || !interfere {
        return Ok(());
    }
    // The later one is to blame, unless it is not of the plan.
    let blamed = second.what.step().or(first.what.step());
    let mistake = Mistake::Interference {
        first: judge.occurrence(first.what, &first.time),
        second: judge.occurrence(second.what, &second.time),
        over: over(judge.task, &first.footprint, &second.footprint),
        separation: (judge.settings.needs_separation).then(|| judge.task.epsilon().clone()),
    };
    Err(judge.violation(&second.time, blamed, mistake))
}

/// The first fact or fluent over which two footprints interfere.
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
