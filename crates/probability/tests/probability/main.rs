//! Integration tests of probabilities, compared with enumerated and simulated worlds.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod best_order;
mod dispatch;
mod exact;
mod likelihoods;
mod loss_analysis;
mod optimum;
mod order_tracking;
mod partial_order;
mod pgmpy;
mod published;
mod reachable;
mod reference;
mod shared;
mod untimed_worlds;
