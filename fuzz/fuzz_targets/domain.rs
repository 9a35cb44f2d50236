//! Arbitrary bytes as a domain.

#![no_main]

use elbowroom_pddl::{Source, read_problem};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let domain = Source::from_bytes("domain.pddl", bytes);
    let problem = Source::new("problem.pddl", include_str!("../fixed/problem.pddl"));
    if let Err(diagnostics) = read_problem(&domain, &problem) {
        diagnostics.render(false);
    }
});
