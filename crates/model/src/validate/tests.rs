//! Tests of each sentence of the definition of a valid plan, with small plans.

mod conditions;
mod constraints;
mod continuous;
mod durations;
mod effects;
mod executions;
mod explanations;
mod forms;
mod groups;
mod pieces;
mod plans;
mod polynomials;
mod world;
