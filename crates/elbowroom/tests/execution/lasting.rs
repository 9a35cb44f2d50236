//! Runs that go on when their goal is reached: what is asked of them while they run, and what comes
//! of it. No clock and no files: a script says when what is asked or seen.

mod amid;
mod anew;
mod attended;
mod changes;
mod choosing;
mod goals;
mod pauses;
pub(crate) mod scripted;
