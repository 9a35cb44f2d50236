//! Integration tests of the readers and writers of PDDL.
#![allow(clippy::unwrap_used, reason = "a helper that panics fails the test")]

mod actions;
mod benchmarks;
mod constraints;
mod control_parameters;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../examples/pddl_support/document.rs"]
mod document;
mod grounding;
mod mistakes;
mod object_fluents;
mod plan_lines;
mod plans;
mod problems;
mod processes_and_events;
mod reachability;
mod reading;
mod refusals;
mod robustness;
#[path = "../../../../testing/skipped.rs"]
mod skipped;
mod small_changes;
mod small_steps;
#[allow(dead_code, unused_imports, reason = "shared with other programs")]
#[path = "../../examples/pddl_support/survey.rs"]
mod survey;
mod val_program;
mod val_verdicts;
mod writing;
