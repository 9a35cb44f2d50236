//! Execution of plans: runs from their specifications.
//!
//! [`execute()`] executes a plan in a world of the caller with one call. [`Execution`] builds a run
//! from an executor, a planner, a preparer and a recorder. [`RunSpec`] is the specification of a
//! run as data, and [`RunInputs`] the same with its texts read. All but the specification is in the crate `elbowroom-selection`.

mod spec;

pub use elbowroom_selection::{
    ActionSets, AdversarialWorld, CachingPlanner, CachingPreparer, Candidate, Candidates, Choice,
    Embedded, ExactRegion, Execution, External, Findings, FirstPlan, FnPlanner, Limits, Listener,
    MostProbablePlanner, PLANNING_BUDGET, Pace, PlanPreparer, PlanSelector, Replanning,
    RolloutPolicy, RolloutSession, Rollouts, RunRollouts, SelectingPlanner,
    SharedMostProbablePlanner, SharedRolloutPolicy, UnknownFirstPlan, Validated, Value,
    WorldKnowledge, action_values, check_vary, execute, ill_typed_part, obstacle_to_deadline,
    planning_work, read_goal, rewrite,
};
pub use spec::{
    AdversaryError, AdversarySettings, EMBEDDED, FirstPlanError, MAX_STATES, NO_PLANNER, NamedText,
    RunInputs, RunSpec, SpecError, WorldNames,
};
pub(crate) use spec::{as_text, listed};
