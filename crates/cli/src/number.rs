//! Formatting of exact numbers.

pub(crate) use elbowroom::report::decimal::{Rounding, nearest, rounded};
