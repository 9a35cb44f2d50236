//! Integration tests of probabilities, compared with enumerated and simulated worlds.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod account;
mod best_order;
mod dispatch;
mod exact;
mod following;
mod likelihoods;
mod optimum;
mod partial_order;
mod pgmpy;
mod published;
mod shared;
mod twin;
mod untimed_worlds;
