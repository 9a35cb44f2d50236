//! Complete runs: executors, worlds, planner and envelopes together.

mod adaptable;
mod amounts;
mod anticipated_replans;
mod background_planner;
mod background_planning;
mod background_preparation;
mod bad_worlds;
mod better;
mod beyond_analysis;
mod chosen_durations;
mod continuation;
mod coupled;
mod esterel;
mod guarantee;
mod handover;
mod late_actions;
mod likelier;
mod literal;
mod lookahead;
mod numbers;
mod openings;
#[path = "../../examples/promise/own.rs"]
mod own;
mod persistent;
mod plan_switches;
mod planned_durations;
mod random_events;
mod reasons;
mod recorded;
mod refusals;
mod reports;
mod scene;
#[path = "../shared/mod.rs"]
mod shared;
mod shutdown;
mod simultaneous_happenings;
mod spec;
mod stepwise;
mod third_party_problems;
mod timeouts;
mod traces;
mod uncertain_facts;
mod undone_failures;
mod validated;
mod zero_durations;
