//! Boxes with maximal ends, each end moved outwards. The larger box must be rejected. If the reason
//! is missing knowledge of the future, the spoiler must defeat the executors.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

use elbowroom::envelope::{Guarantee, Objection, Oracle, sharpen};
use elbowroom::execution::run::TimeoutRule;
use elbowroom::num::Rational;
use elbowroom::plan::{BoxEnd, DecoupledEnvelope, ParametrizedPlan};

use super::options::Options;
use super::sources::Source;
use super::subject::Subject;
use super::trial::{Ready, Search};
use super::worlds::Worlds;
use super::{results_by_family, skipped_table};

/// Step size of an end (β).
const PRECISION: Rational = Rational::ONE;

/// Executors that use the planned schedule instead of a box.
const EXECUTORS: [&str; 2] = ["stn", "fixed:60"];

/// Counts over all ends of one plan.
#[derive(Clone, Debug, Default)]
struct Row {
    /// Ends that are unlimited, or limited only by the parameter's range.
    free: usize,
    /// Ends that were accepted after the move, which is a bug.
    accepted: usize,
    no_schedule: usize,
    broken: usize,
    uncontrollable: usize,
    /// Number of uncontrollable ends for which the spoiler defeats each executor.
    defeated: [usize; EXECUTORS.len()],
}

pub(crate) fn main(options: &Options) {
    let (families, skipped) = results_by_family(options, &|source| {
        row(source, options).map(|row| (source.family.clone(), row))
    });
    println!(
        "| family | plans | free ends | no schedule | broken | no executor could know | spoiler beats {} \
         | accepted |",
        EXECUTORS.join(" | ")
    );
    println!("|---|--:|--:|--:|--:|--:|--:|--:|--:|");
    for (family, rows) in &families {
        println!("| {family} {}", line(&rows.iter().collect::<Vec<_>>()));
    }
    let all: Vec<&Row> = families.values().flatten().collect();
    println!("| **all** {}", line(&all));
    print!("{}", skipped_table(&skipped));
}

fn line(rows: &[&Row]) -> String {
    let sum = |count: &dyn Fn(&Row) -> usize| rows.iter().map(|row| count(row)).sum::<usize>();
    format!(
        "| {} | {} | {} | {} | {} | {} | {} | {} |",
        rows.len(),
        sum(&|row| row.free),
        sum(&|row| row.no_schedule),
        sum(&|row| row.broken),
        sum(&|row| row.uncontrollable),
        sum(&|row| row.defeated[0]),
        sum(&|row| row.defeated[1]),
        sum(&|row| row.accepted),
    )
}

#[allow(
    clippy::disallowed_methods,
    reason = "boxes are widened for a limited time"
)]
fn row(source: &Source, options: &Options) -> Result<Row, String> {
    let subject = Subject::of_source(source, &options.planning)?;
    let begin = Instant::now();
    let may_continue = || begin.elapsed() < options.time_per_box;
    let search = Search {
        most_checks: usize::MAX,
        may_continue: &may_continue,
    };
    let ready = Ready::new(&subject, search)?;
    let plan = Arc::new(ready.open.plan.clone());
    let oracle = Oracle::new(&subject.task, &plan, Guarantee::Dynamic);
    let mut oracle = oracle.map_err(|_| "beyond exact analysis")?;
    let mut is_sharp = true;
    let sharp = sharpen(&mut oracle, ready.envelope(), &mut || {
        is_sharp &= may_continue();
        if is_sharp {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    let sharp = sharp.map_err(|_| "beyond exact analysis")?;
    let sharp = sharp.ok_or("a box that was found and is not inside")?;
    if !is_sharp {
        return Err("a box that was still growing when the time was up".to_owned());
    }
    let mut row = Row::default();
    for end in BoxEnd::all(plan.parameters.len()) {
        let Some(grown) = grown(&sharp, end, &plan) else {
            row.free += 1;
            continue;
        };
        match oracle
            .objection(&grown)
            .map_err(|_| "beyond exact analysis")?
        {
            None => {
                eprintln!("{} {}: {end:?} accepted", subject.family, subject.name);
                row.accepted += 1;
            }
            Some(Objection::NoSchedule(_)) => row.no_schedule += 1,
            Some(Objection::Uncontrollable(_)) => {
                row.uncontrollable += 1;
                for (count, is_spoiled) in row
                    .defeated
                    .iter_mut()
                    .zip(defeated_executors(&ready, &grown))
                {
                    *count += usize::from(is_spoiled);
                }
            }
            Some(_) => row.broken += 1,
        }
    }
    Ok(row)
}

/// Returns the box with an end moved outwards, or `None` if only the parameter's range limits it.
fn grown(
    sharp: &DecoupledEnvelope,
    end: BoxEnd,
    plan: &ParametrizedPlan,
) -> Option<DecoupledEnvelope> {
    let reach = end.reach(sharp)?;
    let border = end.side.reach(&plan.parameter(end.parameter).range);
    if border.as_ref().is_some_and(|border| reach >= *border) {
        return None;
    }
    let further = reach + PRECISION;
    let further = border.map_or(further.clone(), |border| border.min(further));
    Some(end.with_reach(sharp, Some(further)))
}

/// Returns `true` for each executor that fails against the spoiler.
fn defeated_executors(ready: &Ready<'_>, envelope: &DecoupledEnvelope) -> [bool; EXECUTORS.len()] {
    let worlds = Worlds::new(&ready.subject.task, &ready.open, envelope);
    EXECUTORS.map(|executor| {
        let world = worlds.spoiled(&TimeoutRule::Off);
        world.is_some_and(|mut world| ready.run(executor, &mut world).failure.is_some())
    })
}
