//! The process: a task in a world, compiled into bits for facts, actions and events.

pub(crate) mod action_model;
mod applicable;
mod compile;
mod failures;
mod numbers;
pub(crate) mod value_intervals;
pub(crate) mod world;

pub use action_model::{ActionModel, Event, Facts, FailureKind, Needs, Snap};
pub use world::TimedWorld;
