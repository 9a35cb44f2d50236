//! Integration tests of the checker of certificates.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/game.rs"]
mod game;
mod no_plan;
mod strategies;
