//! Seeded worlds to execute plans in.
//!
//! In: a world file (`docs/reference/formats/world.md`) and a seed. Out: a
//! [`World`](elbowroom_execution::World) that executes commands with durations and failures of its
//! own.
//!
//! - [`WorldModel`]: the contents of a world file: distributions of durations and of numeric
//!   changes, failures, exogenous events, and the reliability of reports.
//! - [`SimWorld`]: one trajectory of it, by the semantics of PDDL: conditions are evaluated in the
//!   true state, and an action whose conditions do not hold fails.
//! - [`FaultInjector`]: loses, repeats, delays and contradicts the reports of another world.
//!
//! Randomness is keyed ([`draw`]): the duration of the second time that `(pick rover box)` starts
//! depends on the seed, on `(pick rover box)` and on 2, and on nothing else. Two executors that
//! meet the same seed therefore meet the same world, as far as they do the same (common random
//! numbers), and their results can be compared in pairs.
//!
//! ```
//! use elbowroom_model::Problem;
//! use elbowroom_sim::WorldModel;
//!
//! let text = r#"
//!     format = "elbowroom-world"
//!     version = 1
//!
//!     [[duration]]
//!     action = "*"
//!     normal = { mean = 1, deviation = 0.2, minimum = 0.5 }
//!     relative = true
//! "#;
//! let model = WorldModel::read(text, &Problem::default())?;
//! assert!(model.reports.is_perfect());
//! # Ok::<(), elbowroom_text::Diagnostics>(())
//! ```

mod cdf;
pub mod draw;
mod duration_control;
mod fault_injection;
mod model;
mod pattern;
mod sim;

pub use cdf::{Side, rounding_edge};
pub use draw::{Distribution, Purpose};
pub use duration_control::{ControlledWorld, DurationController, FixedDurations, StartedAction};
pub use elbowroom_model::pattern::ActionPattern;
pub use fault_injection::FaultInjector;
pub use model::{
    Amount, ExogenousChange, ExogenousEvent, FactOutcome, FailureRule, FailureTime, Hazard,
    Outcome, OutcomeChange, ReportReliability, Rule, Template, WorldModel,
};
pub use sim::{ObservedChanges, SimWorld};
