//! Integration tests of the embedded planner.

mod embedded;
mod modules;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/solvable/mod.rs"]
mod solvable;
mod solvable_problems;
