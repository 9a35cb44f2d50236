//! Integration tests of simulated worlds.

mod amid;
mod failures;
mod hazards;
mod one_time;
mod outcomes;
mod world_files;
