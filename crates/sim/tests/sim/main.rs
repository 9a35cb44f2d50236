//! Integration tests of simulated worlds.

mod failures;
mod hazards;
mod mid_execution;
mod outcomes;
mod simultaneous_events;
mod world_files;
