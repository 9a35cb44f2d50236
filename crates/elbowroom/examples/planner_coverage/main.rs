//! Coverage and speed of planners on benchmarks.
//!
//! ```text
//! planner_coverage run --data FOLDER --planner NAME … -o FILE.csv
//!       [--time S] [--memory MB] [--jobs N] [--only TEXT] [--every K] [--first]
//!       [--val PROGRAM]
//! planner_coverage table FILE.csv [--first]
//! ```
//!
//! `run` runs each planner (`embedded`, those of the registry, `up:ENGINE`, or a command line) on
//! each temporal instance of `FOLDER/manifest.csv`, and appends one line for each to the file. The
//! manifest's first line names its columns. The columns `domain`, `instance`, `domain_file` and
//! `problem_file` are required; `collection`, `durative_actions`, `domain_features` and
//! `problem_features` are optional. Runs that are already in the file are skipped, so an
//! interrupted run can be continued. `--only` selects instances whose line in the manifest contains
//! the text; `--every` selects each Kth instance of a domain; `--first` stops a planner at its
//! first plan; `--val` also validates the last plan with VAL's `Validate`. `table` converts the
//! file to Markdown, with `--first` without scores.
//!
//! `--time` is processor time, so that the load of the machine does not change the results.
//!
//! All planners run as processes under the same supervision, including the embedded one (this
//! program calls itself). So times include the start of the process, and memory is measured in the
//! same way. Only plans that the validator accepts count.
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
        _ => Err(
            "expected `run` or `table` as the first word; see the source for the options"
                .to_owned(),
        ),
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(2)
        }
    }
}
