//! Formatting of exact numbers.

pub(crate) use elbowroom::report::short::{Rounding, between, nearest, rounded};
