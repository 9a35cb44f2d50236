//! Integration tests of temporal networks: consistency, controllability, and their certificates.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod beyond;
mod controllability;
mod examples;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/game.rs"]
mod game;
mod moving;
mod oracle;
mod properties;
mod recheck;
mod refutation;
mod rows;
