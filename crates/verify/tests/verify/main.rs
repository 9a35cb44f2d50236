//! Integration tests of the checker of certificates.

#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/game.rs"]
mod game;
mod no_plan;
mod strategies;
