//! The semantics of temporal planning: problems, ground actions, states, time-triggered plans, and
//! the validator.
//!
//! Input: a [`Problem`], lowered from text by `elbowroom-pddl` or built by a program. Output:
//! ground actions, states, and verdicts.
//!
//! Main parts of the crate:
//!
//! 1. [`problem`]: the lifted problem, names resolved to ids, types, schemas, timed initials.
//! 2. [`ground`]: conditions, expressions, effects and actions without variables.
//! 3. [`Task`]: a problem with its table of ground facts and fluents; instantiates schemas on
//!    demand ([`Task::instantiate`]).
//! 4. [`TimeTriggeredPlan`]: actions with start times and durations, as planners print them.
//! 5. [`Situation`]: a state during the execution of a plan, with running actions.
//! 6. [`validate()`], [`validate_from()`]: the validator. It decides by the semantics of PDDL 2.1
//!    alone and shares no code with networks, encodings or solvers, because their results are
//!    tested with it.
//!
//! Semantics: Fox & Long, "PDDL2.1: An Extension to PDDL for Expressing Temporal Planning Domains",
//! JAIR 20 (2003), with the timed initial literals of PDDL 2.2, and the processes and events of
//! PDDL+ ([`autonomous`]).
//!
//! ```
//! use elbowroom_model::problem::{Body, Condition, Schema};
//! use elbowroom_model::validate::{Settings, Verdict, validate};
//! use elbowroom_model::{Problem, Step, Task, TimeTriggeredPlan};
//!
//! let mut problem = Problem::default();
//! problem.schemas.push(Schema {
//!     name: "beep".to_owned(),
//!     parameters: Vec::new(),
//!     unknowns: Vec::new(),
//!     body: Body::Instantaneous {
//!         condition: Condition::TRUE,
//!         effects: Vec::new(),
//!     },
//! });
//! let task = Task::new(problem);
//! let beep = task.problem().schema("beep").ok_or("it is there")?;
//! let action = task.instantiate(beep, &[])?;
//!
//! let mut plan = TimeTriggeredPlan::default();
//! plan.steps.push(Step {
//!     start: 2.into(),
//!     action: action.into(),
//!     duration: None,
//! });
//! match validate(&task, &plan, &Settings::default()) {
//!     Verdict::Valid(report) => assert_eq!(report.makespan, 2.into()),
//!     _ => panic!("nothing speaks against it"),
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod autonomous;
pub mod constraint;
pub mod derivation;
mod describe;
mod domains;
pub mod expected_durations;
pub mod expression;
pub mod ground;
mod grounder;
mod hash;
mod instantiate;
mod interference;
mod lookup;
pub mod pattern;
mod plan;
pub mod problem;
pub mod reachability;
mod residual;
mod simplify;
mod situation;
mod state;
mod table;
mod task;
mod terms;
pub mod validate;

pub use autonomous::Autonomous;
pub use constraint::{Constraints, Modal};
pub use derivation::GroundRule;
pub use instantiate::InstantiateError;
pub use interference::Footprint;
pub use plan::{Step, TimeTriggeredPlan};
pub use problem::Problem;
pub use simplify::Constants;
pub use situation::{RunningAction, Situation};
pub use state::{State, TimedHappening};
pub use task::Task;
pub use validate::{Verdict, validate, validate_from};
