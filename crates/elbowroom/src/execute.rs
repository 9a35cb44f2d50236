//! Execution of plans: implementations of the ports of [`execution`](crate::execution).
//!
//! [`execute()`] executes a plan in a world of the caller with one call. [`Execution`] builds a run
//! from an executor, a planner, a preparer and a recorder.

mod adversarial_world;
mod cache;
mod candidates;
mod deadlines;
mod execution;
mod external;
mod goal_types;
mod open_durations;
mod plan_preparer;
mod plan_selection;
mod planners;
mod probability_comparator;
mod propositional;
mod race;
mod relevant_actions;
pub mod rewrite;
mod rollout_policy;
mod rollouts;
mod shortfall;
mod spec;
mod validating_recorder;
mod vary;

pub use adversarial_world::AdversarialWorld;
pub use cache::{CachingPlanner, CachingPreparer};
pub use candidates::{Candidate, Candidates, Limits, Pace};
pub use deadlines::obstacle_to_deadline;
pub use execution::{Execution, Listener, execute, read_goal};
pub use external::External;
pub use goal_types::ill_typed_part;
pub use plan_preparer::{ExactRegion, PlanPreparer};
pub(crate) use plan_selection::renumbered;
pub use plan_selection::{
    Choice, FirstPlan, PlanSelector, SelectingPlanner, UnknownFirstPlan, Value, WorldKnowledge,
};
pub(crate) use planners::{CERTIFICATE_WORK, WITHOUT_SELF_OVERLAP, certificate_work, exhausted};
pub use planners::{Embedded, FnPlanner, PLANNING_BUDGET, planning_work};
pub use probability_comparator::{MostProbablePlanner, SharedMostProbablePlanner};
pub(crate) use propositional::with_fixed_durations;
pub(crate) use race::is_behind;
pub use relevant_actions::ActionSets;
pub use rollout_policy::{RolloutPolicy, SharedRolloutPolicy};
pub use rollouts::{Replanning, RolloutSession, Rollouts};
pub use spec::{
    AdversaryError, AdversarySettings, EMBEDDED, FirstPlanError, MOST_STATES, NO_PLANNER,
    NamedText, RunSpec, SpecError,
};
pub(crate) use spec::{as_text, listed};
pub use validating_recorder::{Findings, Validated};
pub use vary::check_vary;
