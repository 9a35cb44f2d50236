//! Execution of every plan without deviations: no executor may fail.

use std::fmt::Write as _;
use std::time::Instant;

use super::options::Options;
use super::sources::Source;
use super::subject::Subject;
use super::trial::{Ready, Search};
use super::{results_by_family, skipped_table};

/// Executors with a promise, and two for comparison.
const EXECUTORS: [&str; 5] = ["guarded", "live", "stn", "fixed:60", "esterel"];

/// Number of executors that must not fail, for any order of the lines of the plan.
const KEEP: usize = 3;

/// Result of one plan.
struct Row {
    /// `true` for each executor that failed.
    failed: [bool; EXECUTORS.len()],
    /// `true` if an executor failed with the lines in another order.
    is_order_missed: bool,
}

pub(crate) fn main(options: &Options) {
    let (families, skipped) = results_by_family(options, &|source| {
        row(source, options).map(|row| (source.family.clone(), row))
    });
    println!(
        "| family | plans | {} | lines in another order |",
        EXECUTORS.join(" | ")
    );
    println!("|---|--:|{}--:|", "--:|".repeat(EXECUTORS.len()));
    for (family, rows) in &families {
        println!("| {family} {}", line(&rows.iter().collect::<Vec<_>>()));
    }
    let all: Vec<&Row> = families.values().flatten().collect();
    println!("| **all** {}", line(&all));
    print!("{}", skipped_table(&skipped));
}

fn line(rows: &[&Row]) -> String {
    let mut line = format!("| {} |", rows.len());
    for executor in 0..EXECUTORS.len() {
        let failed = rows.iter().filter(|row| row.failed[executor]).count();
        let _ = write!(line, " {failed} |");
    }
    let missed = rows.iter().filter(|row| row.is_order_missed).count();
    let _ = write!(line, " {missed} |");
    line
}

#[allow(
    clippy::disallowed_methods,
    reason = "boxes are widened for a limited time"
)]
fn row(source: &Source, options: &Options) -> Result<Row, String> {
    let subject = Subject::of_source(source, &options.planning)?;
    let label = format!("{} {}", subject.family, subject.name);
    let begin = Instant::now();
    let may_continue = || begin.elapsed() < options.time_per_box;
    let search = Search {
        most_checks: usize::MAX,
        may_continue: &may_continue,
    };
    let ready = Ready::new(&subject, search).inspect_err(|why| eprintln!("{label}: {why}"))?;
    let failed = EXECUTORS.map(|executor| {
        let outcome = ready.run_as_planned(executor);
        let is_failed = outcome.failure.is_some();
        if let Some(failure) = outcome.failure
            && EXECUTORS[..KEEP].contains(&executor)
        {
            eprintln!("{label}: {executor}: {failure}: {}", outcome.why);
        }
        is_failed
    });
    let mut is_order_missed = false;
    if let Some(turned) = subject.turned_round() {
        let begin = Instant::now();
        let may_continue = || begin.elapsed() < options.time_per_box;
        let search = Search {
            most_checks: 20,
            may_continue: &may_continue,
        };
        let failures = match &turned {
            Ok(turned) => match Ready::new(turned, search) {
                Ok(ready) => EXECUTORS[..KEEP]
                    .iter()
                    .filter_map(|executor| {
                        let outcome = ready.run_as_planned(executor);
                        Some(format!("{executor}: {}: {}", outcome.failure?, outcome.why))
                    })
                    .collect(),
                Err(why) => vec![why],
            },
            Err(why) => vec![why.clone()],
        };
        for failure in &failures {
            eprintln!("{label}, in another order: {failure}");
        }
        is_order_missed = !failures.is_empty();
    }
    Ok(Row {
        failed,
        is_order_missed,
    })
}
