//! Integration tests of envelopes: found boxes, and oracles that decide the same questions in other ways.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod best;
mod best_probability;
mod deordered_plans;
mod faults;
mod found_bugs;
mod given;
mod irr;
mod oracle;
#[path = "../../../../testing/sampled.rs"]
mod sampled;
mod second_oracle;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
