//! Integration tests of comparisons, optima, and policies.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod believed;
mod campaigns;
mod first_plans;
mod perturbed;
mod policy;
mod rehearsal;
mod same_orders;
#[path = "../../../../testing/sampled.rs"]
mod sampled;
mod shared;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod storm;
mod tables;
mod timed;
mod twin;
