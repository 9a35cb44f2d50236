//! Execution of every plan with all durations in their intervals of the dynamic box. There must be
//! no failure and no replanning, and the validator must accept the execution.

use std::fmt::Write as _;
use std::time::Instant;

use super::options::Options;
use super::sources::Source;
use super::subject::Subject;
use super::tally::{Tally, run};
use super::trial::{Ready, Search};

use super::worlds::{Kind, Worlds};
use super::{results_by_family, skipped_table};

#[allow(clippy::disallowed_methods, reason = "runs are timed")]
pub(crate) fn main(options: &Options) {
    let begin = Instant::now();
    let (families, skipped) = results_by_family(options, &|source| tally(source, options));
    let kinds = Kind::ALL.map(Kind::name).join(" | ");
    let columns = "--:|".repeat(Kind::ALL.len());
    println!("| family | plans | {kinds} | failures |\n|---|--:|{columns}--:|");
    for (family, tallies) in &families {
        println!("| {family} {}", line(&tallies.iter().collect::<Vec<_>>()));
    }
    let all: Vec<&Tally> = families.values().flatten().collect();
    println!("| **all** {}", line(&all));
    print!("{}", skipped_table(&skipped));
    let seconds = begin.elapsed().as_secs();
    let runs: u64 = all.iter().map(|tally| tally.runs()).sum();
    println!("\n{runs} runs, {seconds} s.");
    for kind in [Kind::Outside, Kind::LateLook] {
        let counts = all.iter().filter_map(|tally| tally.counts.get(&kind));
        let given_up: u64 = counts.map(|count| count.given_up).sum();
        println!("{}: abandoned {given_up} times.", kind.name());
    }
}

fn line(tallies: &[&Tally]) -> String {
    let mut line = format!("| {} |", tallies.len());
    let mut failed = 0;
    for kind in Kind::ALL {
        let counts = tallies.iter().filter_map(|tally| tally.counts.get(&kind));
        let (mut runs, mut own) = (0, 0);
        for count in counts {
            runs += count.runs;
            own += count.failed;
        }
        failed += own;
        let _ = write!(line, " {runs} |");
    }
    let _ = write!(line, " {failed} |");
    line
}

#[allow(
    clippy::disallowed_methods,
    reason = "boxes and runs have a limited time"
)]
fn tally(source: &Source, options: &Options) -> Result<(String, Tally), String> {
    let subject = Subject::of_source(source, &options.planning)?;
    let begin = Instant::now();
    let may_continue = || begin.elapsed() < options.time_per_box;
    let search = Search {
        most_checks: usize::MAX,
        may_continue: &may_continue,
    };
    let ready = Ready::new(&subject, search)?;
    let worlds = Worlds::new(&subject.task, &ready.open, ready.envelope());
    let mut tally = Tally::default();
    let begin = Instant::now();
    for number in 0..options.runs {
        if begin.elapsed() > options.time_per_plan {
            break;
        }
        run(&ready, &worlds, number, &mut tally);
    }
    let label = format!("{} {}", subject.family, subject.name);
    match &tally.failure {
        Some(failure) => eprintln!("{label}: {failure}"),
        None => eprintln!("{label}: {} runs", tally.runs()),
    }
    Ok((subject.family.clone(), tally))
}
