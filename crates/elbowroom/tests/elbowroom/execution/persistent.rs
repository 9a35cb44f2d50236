//! Persistent runs, which continue after their goal is reached: their requests, and the results.
//! There is no clock and no file; a script determines the times of requests and observations.

mod changes;
mod goal_selection;
mod goals;
mod interactive;
mod kept;
mod pauses;
mod queued;
mod resumption;
mod rotation;
pub(crate) mod scripted;
