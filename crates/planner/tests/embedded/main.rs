//! The embedded planner: supported features, proofs, and a comparison with an exhaustive search.

#![allow(
    clippy::unwrap_used,
    clippy::format_collect,
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

mod calendars;
mod cancellation;
mod concurrency;
mod course;
mod course_twin;
mod deadlines;
mod drains;
mod features;
mod memory;
mod metric;
mod moments;
mod moving_numbers;
mod off_grid;
mod portfolio;
mod refinement;
mod resources;
mod self_overlap;
mod situations;
mod threads;
mod twin;
mod world;
