//! Integration tests of comparisons, optima, and policies.

mod believed;
mod campaigns;
mod first_plans;
mod perturbed;
mod policy;
mod rehearsal;
mod same_orders;
mod shared;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod storm;
mod tables;
mod timed;
mod twin;
