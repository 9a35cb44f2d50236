//! Formatting of exact numbers.

pub(crate) use elbowroom::report::decimal::{Rounding, rounded_inwards, nearest, rounded};
