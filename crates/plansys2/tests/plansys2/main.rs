//! Integration tests of the bridge to `PlanSys2`.

mod adversary;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod twin;
