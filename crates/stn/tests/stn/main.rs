//! Integration tests of temporal networks: consistency, controllability, and their certificates.

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
