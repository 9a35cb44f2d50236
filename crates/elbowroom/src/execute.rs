//! Execution of plans: implementations of the ports of [`execution`](crate::execution).
//!
//! [`execute()`] executes a plan in a world of the caller with one call. [`Execution`] builds a run
//! from an executor, a planner, a preparer and a recorder.

mod action_sets;
mod analyst;
mod candidates;
mod deadlines;
mod execution;
mod external;
mod facts_only;
mod first_plan;
mod likeliest;
mod memory;
mod misfit;
mod open_durations;
mod planners;
mod race;
mod rehearse;
pub mod rewrite;
mod rollouts;
mod shortfall;
mod spec;
mod spoiling;
mod validated;
mod vary;

pub use action_sets::ActionSets;
pub use analyst::{Analyst, WholeRegion};
pub use candidates::{Candidate, Candidates, Limits, Pace};
pub use deadlines::obstacle_to_deadline;
pub use execution::{Execution, Listener, execute, read_goal};
pub use external::External;
pub(crate) use facts_only::as_timed;
pub(crate) use first_plan::renumbered;
pub use first_plan::{Choice, Chooser, Choosing, FirstPlan, Known, UnknownFirstPlan, Value};
pub use likeliest::{Likeliest, SharedLikeliest};
pub use memory::{RememberingPlanner, RememberingPreparer};
pub use misfit::misfit;
pub use planners::{Clockless, Embedded, PLANNING_BUDGET, planning_work};
pub(crate) use planners::{WITHOUT_SELF_OVERLAP, exhausted};
pub(crate) use race::is_behind;
pub use rehearse::{Rehearse, SharedRehearse};
pub use rollouts::{Replanning, Rollouts, Tryout};
pub use spec::{
    EMBEDDED, FirstPlanError, MOST_STATES, NOBODY, NamedText, RunSpec, SpecError, Spoiler,
    SpoilerError,
};
pub(crate) use spec::{as_text, listed};
pub use spoiling::Spoiling;
pub use validated::{Findings, Validated};
pub use vary::check_vary;
