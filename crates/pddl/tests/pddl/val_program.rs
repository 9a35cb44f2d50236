//! Compares the validator with VAL, the program that `ELBOWROOM_VAL` names.
//!
//! `docs/research/val-agreement.md` lists the disagreements and their causes.

#![allow(
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

mod cases;
mod conditional;
mod equal;
mod program;
mod trajectory;
