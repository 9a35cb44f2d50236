//! Integration tests of temporal networks in the formats of other programs.

mod formats;
mod published;
mod robustness;
mod samples;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod weak;
