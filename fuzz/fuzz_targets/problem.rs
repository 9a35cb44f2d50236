//! Arbitrary bytes as a problem.

#![no_main]

use elbowroom_pddl::{Source, read_problem};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let problem = Source::from_bytes("problem.pddl", bytes);
    let domain = Source::new("domain.pddl", include_str!("../fixed/domain.pddl"));
    if let Err(diagnostics) = read_problem(&domain, &problem) {
        diagnostics.render(false);
    }
});
