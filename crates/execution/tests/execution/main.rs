//! Integration tests of plan execution that need only this crate.

mod contract;
mod executors_page;
