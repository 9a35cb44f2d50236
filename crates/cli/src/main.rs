//! The command `elbowroom`: how much elbow room a temporal plan has.
//!
//! What it may print, to which stream, and with which exit code it ends is a contract:
//! `docs/exit-codes.md`. All input and output of the workspace happens here; what is computed is
//! computed in the library.

mod limits;
mod look;
mod number;
mod table;

fn main() {}
