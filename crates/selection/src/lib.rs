//! Runs of plans from their parts, and the choice between plans.
//!
//! - [`Execution`] builds a run from an executor, a planner, a preparer and a recorder;
//!   [`execute()`] executes a plan in a world of the caller with one call.
//! - [`Embedded`], [`External`], [`FnPlanner`], [`PlanPreparer`]: planners and preparers behind the
//!   ports of [`elbowroom_execution`]; [`CachingPlanner`], [`CachingPreparer`] reuse answers.
//! - [`mod@box_search`]: the search for the box of a plan, with the settings of a run's envelope.
//! - [`Candidates`]: different plans for a problem, from variants of it.
//! - [`Rollouts`]: success rates of plans in simulated runs. [`PlanSelector`] races candidates in
//!   them for the first plan of a run, and [`RolloutPolicy`] the next actions of a run.
//! - [`action_values()`]: the table of action values for executors that use one, with the
//!   [`ActionSets`] that bound it.
//! - [`duration_distributions()`], [`mod@timeouts`]: durations of a plan in a world, and the
//!   time-outs of its actions.
//!
//! This crate knows neither requests nor specifications: those are in the crate `elbowroom`.

mod action_values;
mod adversarial_world;
pub mod box_search;
mod cache;
mod candidates;
mod deadlines;
mod duration_distributions;
mod execution;
mod external;
mod goal_types;
mod open_durations;
mod plan_preparer;
mod plan_selection;
mod planners;
mod postponement;
mod probability_comparator;
mod propositional;
mod race;
mod relevant_actions;
mod renumbering;
pub mod rewrite;
mod rollout_policy;
mod rollouts;
mod slack;
pub mod timeouts;
mod validating_recorder;
mod vary;

pub use action_values::action_values;
pub use adversarial_world::AdversarialWorld;
pub use box_search::{EnvelopeSettings, Search};
pub use cache::{CachingPlanner, CachingPreparer};
pub use candidates::{Candidate, Candidates, Limits, Pace};
pub use deadlines::obstacle_to_deadline;
pub use duration_distributions::{
    DistributionError, duration_distribution, duration_distributions,
};
pub use execution::{Execution, Listener, RunRollouts, execute, read_goal};
pub use external::External;
pub use goal_types::ill_typed_part;
pub use plan_preparer::{ExactRegion, PlanPreparer};
pub use plan_selection::{
    Choice, FirstPlan, PlanSelector, SelectingPlanner, UnknownFirstPlan, Value, WorldKnowledge,
};
pub use planners::{
    CERTIFICATE_WORK, Embedded, FnPlanner, PLANNING_BUDGET, WITHOUT_SELF_OVERLAP, certificate_work,
    exhausted, planning_work,
};
pub use probability_comparator::{MostProbablePlanner, SharedMostProbablePlanner};
pub use propositional::with_fixed_durations;
pub use race::is_behind;
pub use relevant_actions::ActionSets;
pub use renumbering::renumbered;
pub use rollout_policy::{RolloutPolicy, SharedRolloutPolicy};
pub use rollouts::{Replanning, RolloutSession, Rollouts};
pub use validating_recorder::{Findings, Validated};
pub use vary::check_vary;
