//! Integration tests of the embedded planner.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod embedded;
mod modules;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/solvable/mod.rs"]
mod solvable;
mod solvable_problems;
