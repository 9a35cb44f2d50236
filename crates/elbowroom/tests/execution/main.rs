//! Whole runs: executors, worlds, planner and envelopes together.

mod adaptable;
mod amounts;
mod bad_worlds;
mod campaigns;
mod esterel;
mod guarantee;
mod handover;
mod likelier;
mod literal;
mod lookahead;
mod one_time;
mod others;
mod reasons;
mod reports;
mod scene;
#[path = "../shared/mod.rs"]
mod shared;
mod traces;
