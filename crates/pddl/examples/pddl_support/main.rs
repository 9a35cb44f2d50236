//! Writes `docs/reference/pddl-support.md`: the supported, refused and ignored parts of PDDL, and the results
//! for each domain of the benchmark set.
//!
//! `cargo run --release -p elbowroom-pddl --example pddl_support > docs/reference/pddl-support.md`

#![allow(clippy::print_stdout, reason = "an example shows its result")]

mod document;
mod survey;

fn main() {
    let survey = survey::folder().map(|folder| survey::survey(&folder));
    print!("{}", document::document(survey.as_ref()));
}
