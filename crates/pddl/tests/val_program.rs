//! The judge beside VAL itself: the program that `ELBOWROOM_VAL` names.
//!
//! What the two disagree on, and why, is told in `docs/val-agreement.md`.

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
#[path = "val_program/course.rs"]
mod course;
#[path = "val_program/equal.rs"]
mod equal;
#[path = "val_program/program.rs"]
mod program;
