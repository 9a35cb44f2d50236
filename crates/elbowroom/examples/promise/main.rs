//! Check of the promises of envelopes on every plan of a folder of benchmarks.
//!
//! ```text
//! promise plan [--data FOLDER] [--plans FOLDER] [--states N] [--seconds S]
//! promise nominal [--data FOLDER] [--plans FOLDER]
//! promise runs [--data FOLDER] [--plans FOLDER] [--runs N] [--each S]
//! promise grow [--data FOLDER] [--plans FOLDER]
//! promise boxes   [--data FOLDER] [--plans FOLDER]
//! ```
//!
//! `plan` computes a plan for each temporal problem with the embedded planner, and stores it as
//! text in the folder `--plans`. The other commands read these plans, and compute missing ones (not
//! with `--seconds 0`). `nominal` executes every valid plan without deviations. `runs` executes
//! each plan in worlds in which every duration is in its interval, at most N times and for at most
//! S seconds. `grow` tries to widen maximal boxes. `boxes` compares boxes of the weak and the
//! dynamic guarantee.
//!
//! `--only TEXT` (repeatable) selects the plans whose family or name contains the text. `--jobs` is
//! the number of threads, and `--widening` the time limit in seconds for widening a box.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]
#![allow(dead_code, reason = "the test uses the rest")]

mod boxes;
mod deviations;
mod grow;
mod lateness;
mod nominal;
mod options;
mod planning;
mod runs;
mod sources;
mod subject;
mod tally;
mod trial;
mod worlds;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};

use options::Options;
use rayon::iter::{IndexedParallelIterator, IntoParallelRefIterator, ParallelIterator};
use sources::{Origin, Source};
use subject::Subject;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().unwrap_or_default();
    let rest: Vec<String> = arguments.collect();
    let outcome = Options::read(&rest).and_then(|options| {
        let threads = rayon::ThreadPoolBuilder::new().num_threads(options.jobs);
        let pool = threads.build().map_err(|error| error.to_string())?;
        let command: fn(&Options) = match command.as_str() {
            "plan" => plan,
            "nominal" => nominal::main,
            "runs" => runs::main,
            "grow" => grow::main,
            "boxes" => boxes::main,
            _ => {
                return Err(
                    "expected plan, nominal, runs, grow or boxes as the first word".to_owned(),
                );
            }
        };
        pool.install(|| command(&options));
        Ok(())
    });
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}

/// Returns the selected sources.
fn selected_sources(options: &Options) -> Vec<Source> {
    let mut sources = sources::sources(&options.data);
    let only = &options.only;
    sources.retain(|source| {
        let name = format!("{} {}", source.family, source.name);
        only.is_empty() || only.iter().any(|text| name.contains(text.as_str()))
    });
    sources
}

/// Function that returns the family of a plan and its result, or why the plan does not count.
type PlanReport<'a, T> = dyn Fn(&Source) -> Result<(String, T), String> + Sync + 'a;

/// Returns the results by family, and the number of plans that do not count by reason.
fn results_by_family<T: Send>(
    options: &Options,
    say: &PlanReport<'_, T>,
) -> (BTreeMap<String, Vec<T>>, BTreeMap<String, usize>) {
    let sources = selected_sources(options);
    let done = AtomicUsize::new(0);
    let said: Vec<_> = sources
        .par_iter()
        .with_max_len(1)
        .map(|source| {
            let said = say(source);
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            if done.is_multiple_of(20) {
                eprintln!("{done}/{}", sources.len());
            }
            said
        })
        .collect();
    let mut families: BTreeMap<String, Vec<T>> = BTreeMap::new();
    let mut skipped = BTreeMap::new();
    for said in said {
        match said {
            Ok((family, said)) => families.entry(family).or_default().push(said),
            Err(why) => *skipped.entry(why).or_default() += 1,
        }
    }
    (families, skipped)
}

/// Returns a table of the plans that do not count.
fn skipped_table(skipped: &BTreeMap<String, usize>) -> String {
    let mut text = String::from("\n| not counted | plans |\n|---|--:|\n");
    for (why, count) in skipped {
        let _ = writeln!(text, "| {why} | {count} |");
    }
    text
}

/// Computes and stores plans.
fn plan(options: &Options) {
    let mut sources = selected_sources(options);
    sources.retain(|source| source.origin == Origin::Planned);
    let done = AtomicUsize::new(0);
    sources.par_iter().for_each(|source| {
        let made = Subject::of_source(source, &options.planning);
        let said = made.map_or_else(|why| why, |_| "a plan".to_owned());
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        eprintln!(
            "{done}/{} {} {}: {said}",
            sources.len(),
            source.family,
            source.name
        );
    });
}
