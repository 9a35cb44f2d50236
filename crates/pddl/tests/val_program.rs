//! Compares the validator with VAL, the program that `ELBOWROOM_VAL` names.
//!
//! `docs/val-agreement.md` lists the disagreements and their causes.

#![allow(
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

#[path = "../../../testing/skipped.rs"]
mod skipped;

#[path = "val_program/cases.rs"]
mod cases;
#[path = "val_program/conditional.rs"]
mod conditional;
#[path = "val_program/equal.rs"]
mod equal;
#[path = "val_program/program.rs"]
mod program;
#[path = "val_program/trajectory.rs"]
mod trajectory;
