//! The embedded planner: supported features, proofs, and a comparison with an exhaustive search.

#![allow(
    clippy::unwrap_used,
    clippy::format_collect,
    clippy::format_push_string,
    reason = "the tests put texts together, and know what is in them"
)]

mod calendars;
mod calendars_with_numbers;
mod cancellation;
mod concurrency;
mod deadlines;
mod drains;
mod features;
mod memory;
mod metric;
mod moving_numbers;
mod off_grid;
mod portfolio;
mod reference;
mod refinement;
mod resources;
mod self_overlap;
mod simultaneity;
mod situations;
mod tariffs;
mod threads;
mod trajectory;
mod trajectory_reference;
mod world;
