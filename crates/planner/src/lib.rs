//! Finds plans: an embedded temporal planner, and any external planner as a supervised process.

#[cfg(feature = "external")]
pub mod external;
