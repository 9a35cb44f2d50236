//! Integration tests of the library as a whole: envelopes, certificates, networks, and plan execution.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod answers;
mod authors_boxes;
mod best_boxes;
mod cases;
mod ccmmz;
mod certificates;
mod chosen_plans;
mod deorder_sound;
mod derived_certificates;
mod execution;
mod export;
mod faults;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/game.rs"]
mod game;
mod golden_runs;
mod improving_plans;
mod kinds;
mod kinds_of_plans;
mod learning;
mod likely_boxes;
mod many_parameters;
mod networks;
mod no_plan;
mod no_plan_claims;
mod nominal_plans;
mod odds;
mod one_envelope;
mod processes_and_events;
mod promise;
mod published_regions;
mod rcll;
mod region;
mod repairs;
mod requests;
mod rounded_plans;
mod sampling;
mod shared;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../../../testing/solvable/mod.rs"]
mod solvable;
mod stn_files;
mod trajectory_constraints;
mod wall_clock_times;
