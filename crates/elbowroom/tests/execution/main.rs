//! Complete runs: executors, worlds, planner and envelopes together.

mod adaptable;
mod amounts;
mod aside;
mod bad_worlds;
mod beside;
mod better;
mod beyond_analysis;
mod carrying_on;
mod coupled;
mod doubts;
mod esterel;
mod foreseen;
mod guarantee;
mod handover;
mod lasting;
mod late;
mod likelier;
mod literal;
mod lookahead;
mod meanwhile;
mod nothing_left;
mod numbers;
mod one_time;
mod openings;
mod others;
#[path = "../../examples/promise/own.rs"]
mod own;
mod planned_durations;
mod readying;
mod reasons;
mod recorded;
mod refusals;
mod reports;
mod scene;
mod seams;
#[path = "../shared/mod.rs"]
mod shared;
mod spec;
mod stepwise;
mod timeouts;
mod told;
mod traces;
mod undone;
mod validated;
mod zero_durations;
