//! Plan execution: dispatching, monitoring and replanning, with a reason for each decision.
//!
//! In: a task, a plan, and observations. Out: decisions, each with its [`Reason`], and in the end a
//! [`Report`](run::Report). This crate uses no clock, no input or output and no randomness: the
//! same history leads to the same decisions, so a simulation, a robot, a test and a stored trace
//! all drive the same code.
//!
//! - [`Executor`]: a dispatch policy. [`executors::EXECUTORS`] lists them all.
//! - [`run::Run`]: the execution loop: decide, wait, take in observations, replan.
//! - [`Progression`]: the believed state, progressed through time and observations.
//! - [`Recorder`]: records a run.
//!
//! External services are ports, that is, traits of this crate: [`World`] (a simulation, a robot),
//! [`Planner`], [`Preparer`], [`Region`] (the deviations that a plan tolerates), [`Odds`] (success
//! probabilities of plans) and [`Outlook`] (success probabilities of moves). This crate does not
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

mod dispatch;
mod event;
mod executor;
pub mod executors;
mod dispatchable_cache;
mod window_propagation;
mod plan_comparison;
mod action_values;
mod planning;
mod preparation;
mod belief_state;
mod measured_amounts;
mod reason;
mod record;
mod rollout;
mod request;
pub mod run;
mod separation;
mod world;

pub use event::{Command, Ending, Event, GoalTerms, Measured, Observation, Request, ActionHandle};
pub use executor::{
    Decided, Decision, Executor, PreparedPlan, DecisionContext, PlanForm, PlanEvent, Order, Planned, StepId,
};
pub use dispatchable_cache::DispatchableCache;
pub use plan_comparison::{SuccessRates, PlanComparator, RemainingPlan};
pub use action_values::{Move, ActionValues, DecisionState, RankedMoves};
pub use planning::{Lateness, NoPlanner, PlanAnswer, Planned as PlannerAnswer, Planner, Shortfall};
pub use preparation::{PrepareError, PreparationResult, Preparer, RegionOracle, PreparationRequest};
pub use belief_state::{Doubt, Guards, BeliefStateParts, BeliefState, RunningActionState, RunningActionParts, EvaluationError};
pub use reason::{Subject, Evidence, Cause, TimedChange, GuaranteeLevel, Reason};
pub use record::{Entry, GoalChange, NoRecord, Recorder, WarningCause};
pub use rollout::{RolloutEvaluator, RolloutResult, RolloutChoice, DecisionPoint, ObservedChange, Informativeness};
pub use request::{Answer, PlanRequest, PortWorkers, PrepareRequest, RequestId, Urgency, Workers};
pub use world::{TimeAdvance, World, WorldError};
