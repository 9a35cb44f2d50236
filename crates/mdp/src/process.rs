//! The process: a task in a world, compiled into bits for facts, actions and events.

pub(crate) mod action_model;
mod applicable;
mod compile;
pub(crate) mod failures;
pub(crate) mod value_intervals;
pub(crate) mod world;

pub use action_model::{ActionModel, Event, Needs, Snap};
pub use failures::FailureKind;
pub use world::{Facts, TimedWorld};
