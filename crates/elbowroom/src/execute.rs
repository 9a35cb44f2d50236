//! Execution of plans: implementations of the ports of [`execution`](crate::execution).
//!
//! [`execute()`] executes a plan in a world of the caller with one call. [`Execution`] builds a run
//! from an executor, a planner, a preparer and a recorder.

mod relevant_actions;
mod plan_preparer;
mod candidates;
mod deadlines;
mod execution;
mod external;
mod propositional;
mod plan_selection;
mod probability_comparator;
mod cache;
mod goal_types;
mod open_durations;
mod planners;
mod race;
mod rollout_policy;
pub mod rewrite;
mod rollouts;
mod shortfall;
mod spec;
mod adversarial_world;
mod validating_recorder;
mod vary;

pub use relevant_actions::ActionSets;
pub use plan_preparer::{PlanPreparer, ExactRegion};
pub use candidates::{Candidate, Candidates, Limits, Pace};
pub use deadlines::obstacle_to_deadline;
pub use execution::{Execution, Listener, execute, read_goal};
pub use external::External;
pub(crate) use propositional::with_fixed_durations;
pub(crate) use plan_selection::renumbered;
pub use plan_selection::{Choice, PlanSelector, SelectingPlanner, FirstPlan, WorldKnowledge, UnknownFirstPlan, Value};
pub use probability_comparator::{MostProbablePlanner, SharedMostProbablePlanner};
pub use cache::{CachingPlanner, CachingPreparer};
pub use goal_types::ill_typed_part;
pub use planners::{FnPlanner, Embedded, PLANNING_BUDGET, planning_work};
pub(crate) use planners::{WITHOUT_SELF_OVERLAP, exhausted};
pub(crate) use race::is_behind;
pub use rollout_policy::{RolloutPolicy, SharedRolloutPolicy};
pub use rollouts::{Replanning, Rollouts, RolloutSession};
pub use spec::{
    EMBEDDED, FirstPlanError, MOST_STATES, NO_PLANNER, NamedText, RunSpec, SpecError, AdversarySettings,
    AdversaryError,
};
pub(crate) use spec::{as_text, listed};
pub use adversarial_world::AdversarialWorld;
pub use validating_recorder::{Findings, Validated};
pub use vary::check_vary;
