//! Runs the embedded planner on random problems that have a plan.
//!
//! ```text
//! cargo run --release -p elbowroom-planner --example solvable -- [FIRST] [COUNT] [STATES] [FOLDER] [KIND]
//! ```
//!
//! `FIRST` (0) is the first seed, `COUNT` (10,000) the number of seeds, `STATES` (20,000) the number of
//! states per problem. Problems without a plan found are written into `FOLDER`, with the plan that
//! solves them. `KIND` is `any` or `numeric`: problems about one changing number. A single problem is printed. The exit code is 1 if a claim was false or a plan invalid.

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "an example shows its result and its progress"
)]

#[path = "../../../../testing/solvable/mod.rs"]
mod solvable;

use std::path::Path;
use std::process::ExitCode;
use std::{env, fs, io};

use solvable::{Outcome, Solvable, Tally};

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let number = |place: usize, default: u64| {
        let argument = arguments.get(place);
        argument.map_or(Some(default), |text| text.parse().ok())
    };
    let (Some(first), Some(count), Some(states)) =
        (number(0, 0), number(1, 10_000), number(2, 20_000))
    else {
        eprintln!("expected numbers: [FIRST] [COUNT] [STATES] [FOLDER]");
        return ExitCode::from(2);
    };
    let folder = arguments.get(3).map(Path::new);
    let draw = match arguments.get(4).map(String::as_str) {
        None | Some("any") => solvable::problem,
        Some("numeric") => solvable::numeric_problem,
        Some(other) => {
            eprintln!("expected `any` or `numeric`, found `{other}`");
            return ExitCode::from(2);
        }
    };
    let (mut tally, mut without) = (Tally::default(), Tally::default());
    for seed in first..first.saturating_add(count) {
        let Some(problem) = draw(seed) else {
            println!("{seed}: no draft is usable");
            continue;
        };
        if count == 1 {
            println!("{problem}");
        }
        let outcome = solvable::outcome(&problem, states);
        tally.count(&outcome);
        if problem.overlaps_itself() {
            let outcome = solvable::outcome_with(&problem, states, false);
            without.count(&outcome);
            if matches!(outcome, Outcome::FalseClaim(_) | Outcome::Invalid(_)) {
                println!("{seed}, without self-overlap: {outcome:?}");
            }
        }
        if outcome == Outcome::Found {
            continue;
        }
        println!("{seed}: {outcome:?} ({})", problem.features);
        if let Some(folder) = folder
            && let Err(error) = write(folder, seed, &problem)
        {
            eprintln!("{}: {error}", folder.display());
            return ExitCode::from(2);
        }
    }
    println!("{tally:?}");
    println!("without self-overlap, where the problem's own plan has it: {without:?}");
    let wrong = [tally, without].map(|tally| tally.false_claims + tally.invalid);
    ExitCode::from(u8::from(wrong != [0, 0]))
}

fn write(folder: &Path, seed: u64, problem: &Solvable) -> io::Result<()> {
    let folder = folder.join(seed.to_string());
    fs::create_dir_all(&folder)?;
    fs::write(folder.join("domain.pddl"), &problem.domain)?;
    fs::write(folder.join("problem.pddl"), &problem.problem)?;
    fs::write(folder.join("plan.plan"), &problem.plan)
}
