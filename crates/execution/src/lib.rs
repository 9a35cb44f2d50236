//! Plan execution: dispatching, monitoring and replanning, with a reason for each decision.
//!
//! In: a task, a plan, and observations. Out: decisions, each with its [`Reason`], and in the end a
//! [`Report`](run::Report). This crate uses no clock, no input or output and no randomness: the
//! same history leads to the same decisions, so a simulation, a robot, a test and a stored trace
//! all drive the same code.
//!
//! - [`Executor`]: a dispatch policy. [`executors::EXECUTORS`] lists them all.
//! - [`run::Run`]: the execution loop: decide, wait, take in observations, replan.
//! - [`BeliefState`]: the believed state, progressed through time and observations.
//! - [`Recorder`]: records a run.
//!
//! External services are ports, that is, traits of this crate: [`World`] (a simulation, a robot),
//! [`Planner`], [`Preparer`], [`RegionOracle`] (the deviations that a plan tolerates), [`PlanComparator`] (success
//! probabilities of plans) and [`ActionValues`] (success probabilities of moves). This crate does not
//! depend on their implementations; in particular, it cannot call a solver.
//!
//! ```
//! use elbowroom_execution::executors::{EXECUTORS, ExecutorSpec};
//!
//! let guarded: ExecutorSpec = "guarded".parse()?;
//! assert_eq!(guarded.registered.name, "guarded");
//! let baseline: ExecutorSpec = "fixed:30".parse()?;
//! assert_eq!(baseline.argument, Some(30.into()));
//! assert!(EXECUTORS.iter().all(|executor| !executor.summary.is_empty()));
//! # Ok::<(), elbowroom_execution::executors::UnknownExecutor>(())
//! ```

mod action_values;
mod belief_state;
mod dispatch;
mod dispatchable_cache;
mod event;
mod executor;
pub mod executors;
mod forward;
mod measured_amounts;
mod plan_comparison;
mod planning;
mod preparation;
mod reason;
mod record;
mod request;
mod rollout;
pub mod run;
mod separation;
mod window_propagation;
mod world;

pub use action_values::{ActionValues, DecisionState, Move, RankedMoves};
pub use belief_state::{
    BeliefState, BeliefStateParts, Doubt, EvaluationError, Guards, RunningActionParts,
    RunningActionState,
};
pub use dispatchable_cache::DispatchableCache;
pub use event::{ActionHandle, Command, Ending, Event, GoalTerms, Measured, Observation, Request};
pub use executor::{
    Decided, Decision, DecisionContext, Executor, Order, PlanEvent, PlanForm, Planned,
    PreparedPlan, StepId,
};
pub use plan_comparison::{PlanComparator, RemainingPlan, SuccessRates};
pub use planning::{Lateness, NoPlanner, PlanAnswer, Planned as PlannerAnswer, Planner, Shortfall};
pub use preparation::{
    PreparationRequest, PreparationResult, PrepareError, Preparer, RegionOracle,
};
pub use reason::{Cause, Evidence, GuaranteeLevel, Reason, Subject, TimedChange};
pub use record::{Entry, GoalChange, NoRecord, Recorder, UnreachedGoal, WarningCause};
pub use request::{Answer, PlanRequest, PortWorkers, PrepareRequest, RequestId, Urgency, Workers};
pub use rollout::{
    DecisionPoint, Informativeness, ObservedChange, RolloutChoice, RolloutEvaluator, RolloutResult,
};
pub use world::{TimeAdvance, World, WorldError};
