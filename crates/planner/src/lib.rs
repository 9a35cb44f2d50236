//! Finds plans: an embedded temporal planner, and any external planner as a supervised process.

pub mod embedded;
#[cfg(feature = "external")]
pub mod external;

pub use embedded::{
    Answer, Counts, Found, Objective, Phase, Progress, Proof, Settings, Stopped, Unsupported, plan,
};
