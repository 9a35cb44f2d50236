//! Integration tests of planners that run as processes.

mod fake_planners;
mod real_planners;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
