//! Persistent runs, which continue after their goal is reached: their requests, and the results.
//! There is no clock and no file; a script determines the times of requests and observations.

mod amid;
mod anew;
mod attended;
mod changes;
mod choosing;
mod goals;
mod pauses;
pub(crate) mod scripted;
