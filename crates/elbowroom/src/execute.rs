//! Executing plans: the ports of [`execution`](crate::execution), with everything that is there
//! behind them.
//!
//! [`execute()`] is one call for a plan in one's own world. [`Execution`] puts a run together from
//! whoever decides, plans, prepares and records.

mod analyst;
mod execution;
mod external;
mod facts_only;
mod likeliest;
mod memory;
mod planners;
pub mod rewrite;
mod spec;
mod spoiling;
mod vary;

pub use analyst::{Analyst, WholeRegion};
pub use execution::{Execution, Listener, execute, read_goal};
pub use external::External;
pub(crate) use facts_only::as_timed;
pub use likeliest::{Likeliest, SharedLikeliest};
pub use memory::{RememberingPlanner, RememberingPreparer};
pub use planners::{Clockless, Embedded};
pub(crate) use spec::listed;
pub use spec::{EMBEDDED, NOBODY, NamedText, RunSpec, SpecError, Spoiler, SpoilerError};
pub use spoiling::Spoiling;
pub use vary::check_vary;
