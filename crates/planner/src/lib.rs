//! Finds plans: an embedded temporal planner, and any external planner as a supervised process.

pub mod embedded;

pub use embedded::{
    Answer, Counts, Found, Objective, Phase, Progress, Proof, Settings, Stopped, Unsupported, plan,
};
