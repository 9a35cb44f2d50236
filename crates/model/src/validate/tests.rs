//! Each sentence of the definition of a valid plan, as a small plan.

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
