//! Integration tests of the bridge to `PlanSys2`.

mod adversary;
mod python_example;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
