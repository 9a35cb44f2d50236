//! Complete runs: executors, worlds, planner and envelopes together.

mod adaptable;
mod amounts;
mod background_planning;
mod bad_worlds;
mod background_planner;
mod better;
mod beyond_analysis;
mod continuation;
mod coupled;
mod uncertain_facts;
mod esterel;
mod anticipated_replans;
mod guarantee;
mod handover;
mod persistent;
mod late_actions;
mod likelier;
mod literal;
mod lookahead;
mod random_events;
mod shutdown;
mod numbers;
mod simultaneous_happenings;
mod openings;
mod third_party_problems;
#[path = "../../examples/promise/own.rs"]
mod own;
mod planned_durations;
mod background_preparation;
mod reasons;
mod recorded;
mod refusals;
mod reports;
mod scene;
mod plan_switches;
#[path = "../shared/mod.rs"]
mod shared;
mod spec;
mod stepwise;
mod timeouts;
mod chosen_durations;
mod traces;
mod undone_failures;
mod validated;
mod zero_durations;
