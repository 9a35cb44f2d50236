//! Which planner solves which benchmark, and how fast.
//!
//! ```text
//! planner_coverage run --data FOLDER --planner NAME … -o FILE.csv
//!                      [--time S] [--memory MB] [--jobs N] [--only TEXT] [--every K] [--first]
//!                      [--val PROGRAM]
//! planner_coverage table FILE.csv [--first]
//! ```
//!
//! `run` has each planner (`embedded`, those of the registry, `up:ENGINE`, or a command line) plan
//! for each temporal instance of `FOLDER/manifest.csv`, and appends one line for each to the file.
//! The manifest's first line names its columns: `domain`, `instance`, `domain_file` and
//! `problem_file` must be among them; `collection`, `durative_actions`, `domain_features` and
//! `problem_features` may. Lines that are there already are not run again, so an interrupted run
//! goes on where it was. `--only` keeps instances whose line in the manifest has the text in it;
//! `--every` each Kth of a domain; `--first` ends a planner at its first plan; `--val` has VAL's `Validate` judge the
//! last plan, too. `table` makes Markdown of the file, with
//! `--first` without scores.
//!
//! `--time` is processor time, so that a busy machine does not change the results.
//!
//! All planners run as processes under the same supervision, the embedded one too (this program
//! calls itself for that), so times include the start of the process, and memory is measured in the
//! same way. Only plans that the judge accepts count.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "that is what the example does"
)]

mod embedded;
mod manifest;
mod row;
mod run;
mod table;
mod val;

use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args().skip(1);
    let command = arguments.next().unwrap_or_default();
    let rest: Vec<String> = arguments.collect();
    let outcome = match command.as_str() {
        "run" => run::main(&rest),
        "table" => table::main(&rest),
        "embedded" => embedded::main(&rest),
        _ => Err("the first word is `run` or `table`; the source says what follows".to_owned()),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}
