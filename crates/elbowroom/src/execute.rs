//! Executing plans: the ports of [`execution`](crate::execution), with everything that is there
//! behind them.

mod analyst;
mod facts_only;
mod memory;
mod planners;

pub use analyst::{Analyst, WholeRegion};
pub use memory::{RememberingPlanner, RememberingPreparer};
pub use planners::{Clockless, Embedded};
