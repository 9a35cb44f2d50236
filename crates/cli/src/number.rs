//! Exact numbers for people.

pub(crate) use elbowroom::report::short::{Rounding, between, nearest, rounded};
