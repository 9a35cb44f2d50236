//! Integration tests of temporal networks: consistency, controllability, and their certificates.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod bound_violations;
mod controllability;
mod examples;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/game.rs"]
mod game;
mod incremental_windows;
mod oracle;
mod plan_networks;
mod properties;
mod recheck;
mod refutation;
