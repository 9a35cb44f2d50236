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
mod forms;
mod horizon;
mod odds;
mod outlook;
mod planning;
mod preparation;
mod progression;
mod quantities;
mod reason;
mod record;
mod rehearsal;
mod request;
pub mod run;
mod separation;
mod world;

pub use event::{Command, Ending, Event, GoalTerms, Measured, Observation, Request, Ticket};
pub use executor::{
    Decided, Decision, Executor, Mission, Moment, Need, News, Order, Planned, StepId,
};
pub use forms::Forms;
pub use odds::{Compared, Odds, Remainder};
pub use outlook::{Move, Outlook, Standing, Weighed};
pub use planning::{Lateness, NoPlanner, PlanAnswer, Planned as PlannerAnswer, Planner, Shortfall};
pub use preparation::{PrepareError, Prepared, Preparer, Region, Wanted};
pub use progression::{Doubt, Guards, Parts, Progression, Underway, UnderwayParts, Unreadable};
pub use reason::{About, Behind, Cause, Changed, Promise, Reason};
pub use record::{Entry, GoalChange, NoRecord, Recorder, WarningCause};
pub use rehearsal::{Rehearsal, Rehearsed, Rehearsing, Scene, SeenChange, Tells};
pub use request::{Answer, PlanRequest, PortWorkers, PrepareRequest, RequestId, Urgency, Workers};
pub use world::{Passage, World, WorldError};
