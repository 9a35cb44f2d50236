//! Whole runs: executors, worlds, planner and envelopes together.

mod bad_worlds;
mod campaigns;
mod guarantee;
mod reasons;
mod scene;
mod traces;
