//! The fast oracle, compared with a brute-force one, an SMT solver, and the validator.
//!
//! Random small plans are generated around a valid schedule. On growing boxes of parameter values,
//! `elbowroom_envelope::Oracle` must agree with
//!
//! - [`plain`]: all orders of all time points, one linear program for each question;
//! - [`smt`]: the encoding of the paper's authors, decided by Z3 (skipped if it is not installed);
//! - the validator: it rejects each counterexample, and accepts each schedule sampled from a box
//!   that is said to be inside.
//!
//! `ELBOWROOM_CASES` is the number of cases, `ELBOWROOM_FIRST_CASE` is the first one.

mod benchmarks;
mod case;
mod contest;
mod generate;
#[path = "../../../elbowroom/tests/elbowroom/shared/instances.rs"]
#[allow(dead_code, reason = "only some figures are asked about")]
mod instances;
mod numbers;
mod plain;
mod polynomial;
mod random;
mod schedules;
mod shrink;
mod smt;
mod system;
mod z3;

use crate::skipped::skipped;
use contest::{Mismatch, Script, Tally, steps};
use generate::generate;
use random::Random;
use z3::Z3;

fn setting(name: &str, default: u64) -> u64 {
    let value = std::env::var(name).ok();
    value
        .and_then(|value| value.parse().ok())
        .unwrap_or(default)
}

fn script(seed: u64, length: usize) -> Script {
    let case = generate(seed);
    let mut dice = Random::new(seed + 1);
    let length = if dice.chance(10) { 3 * length } else { length };
    let steps = steps(&mut dice, &case.parameters, length);
    Script { case, steps }
}

/// Returns all mismatches, shrunk, and statistics.
fn compare(cases: std::ops::Range<u64>, mut solver: Option<Z3>) -> (Tally, Vec<String>) {
    let mut tally = Tally::default();
    let mut complaints = Vec::new();
    for seed in cases {
        let script = script(seed, 7);
        let mut run = |script: &Script| script.run(solver.as_mut());
        match run(&script) {
            Ok(more) => tally.include(more),
            Err(mismatch) => {
                let mut last = mismatch.clone();
                let small = shrink::shrink(&script, &mut |smaller| match run(smaller) {
                    Err(Mismatch { kind, details }) if kind == mismatch.kind => {
                        last = Mismatch { kind, details };
                        true
                    }
                    _ => false,
                });
                complaints.push(format!(
                    "case {seed}: {}\n{}steps {:?}\n",
                    last.kind, last.details, small.steps
                ));
            }
        }
    }
    (tally, complaints)
}

#[allow(clippy::print_stdout, reason = "says what was compared")]
fn expect_agreement(cases: u64, solver: Option<Z3>) {
    let first = setting("ELBOWROOM_FIRST_CASE", 0);
    let cases = setting("ELBOWROOM_CASES", cases);
    let (tally, complaints) = compare(first..first + cases, solver);
    println!("{tally}");
    assert!(
        complaints.is_empty(),
        "{} mismatches:\n{}",
        complaints.len(),
        complaints.join("\n")
    );
}

#[test]
fn fast_oracle_agrees_with_plain_oracle_and_validator() {
    expect_agreement(200, None);
}

#[test]
fn fast_oracle_agrees_with_published_encoding() {
    match Z3::start() {
        Some(solver) => expect_agreement(20, Some(solver)),
        None => skipped("there is no z3 here"),
    }
}
