//! Executing plans: the ports of [`execution`](crate::execution), with everything that is there
//! behind them.

mod analyst;
#[cfg(feature = "external")]
mod external;
mod facts_only;
mod likeliest;
mod memory;
mod planners;
pub(crate) mod rewrite;
mod spoiling;
mod vary;

pub use analyst::{Analyst, WholeRegion};
#[cfg(feature = "external")]
pub use external::External;
pub use likeliest::{Likeliest, SharedLikeliest};
pub use memory::{RememberingPlanner, RememberingPreparer};
pub use planners::{Clockless, Embedded};
pub use spoiling::Spoiling;
pub use vary::check_vary;
