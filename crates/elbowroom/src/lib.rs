//! How much elbow room does a temporal plan have?
//!
//! Elbowroom reads PDDL 2.1 problems with durative actions, and a plan for one, and computes how
//! far each duration, rate or deadline may deviate while the plan is still guaranteed to work.
//! [`flow::robust_plan`] is the whole way; the [`tutorial`] walks it with an example.
//!
//! ```
//! use std::sync::Arc;
//!
//! use elbowroom::flow::{Settings, robust_plan};
//! use elbowroom::model::Task;
//! use elbowroom::pddl::{self, Source};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let domain = Source::new("domain", "
//!     (define (domain post)
//!       (:requirements :durative-actions :timed-initial-literals)
//!       (:predicates (open) (delivered))
//!       (:durative-action deliver :parameters ()
//!         :duration (= ?duration 10)
//!         :condition (at end (open))
//!         :effect (at end (delivered))))");
//! let problem = Source::new("problem", "
//!     (define (problem letter) (:domain post)
//!       (:init (open) (at 30 (not (open))))
//!       (:goal (delivered)))");
//! let (problem, _warnings) = pddl::read_problem(&domain, &problem)?;
//! let mut task = Task::new(problem);
//! let (plan, _warnings) = pddl::read_plan(&Source::new("plan", "0: (deliver) [10]"), &mut task)?;
//!
//! let robust = robust_plan(&Arc::new(task), &plan, &Settings::default())?;
//! let envelope = robust.envelope.expect("the plan works as it is");
//! // The office closes at 30, and delivering may not take longer than that.
//! assert!(envelope.intervals[0].contains(&28.into()));
//! assert!(!envelope.intervals[0].contains(&30.into()));
//! # Ok(())
//! # }
//! ```
//!
//! The crates behind it, each under its own name:
//!
//! - [`num`]: exact rationals and intervals.
//! - [`model`]: problems, plans with fixed times, and the judge ([`model::validate()`]).
//! - [`pddl`]: PDDL and plan text to the model and back.
//! - [`stn`]: temporal networks.
//! - [`plan`]: plans that leave room, and their parameters.
//! - [`envelope`]: the box check, and the search for a box.
//! - [`network`]: temporal networks in the formats of the field, and what can be promised about
//!   them.
//!
//! What stands here adds words to what these find out ([`Explainer`]), reads and writes boxes
//! ([`parse_box`]), and draws pictures ([`graph`]). It does not look at clocks or files, and it
//! does not print.

pub mod answers;
mod box_text;
pub mod compare;
pub mod execute;
mod explain;
pub mod flow;
pub mod graph;
mod makespan;
pub mod network;
pub mod perturbed;
mod plan_file;
mod room;

pub use box_text::{BoxTextError, parse_box, write_box};
pub use elbowroom_envelope as envelope;
pub use elbowroom_execution as execution;
pub use elbowroom_model as model;
pub use elbowroom_num as num;
pub use elbowroom_pddl as pddl;
pub use elbowroom_plan as plan;
pub use elbowroom_planner as planner;
pub use elbowroom_probability as probability;
pub use elbowroom_report as report;
pub use elbowroom_sim as sim;
pub use elbowroom_stn as stn;
pub use explain::{Explainer, Explanation, Shortfall};
pub use makespan::earliest_end;
pub use plan_file::{AnyPlan, PlanKind};

/// Longer reading. Its code is compiled and run with the tests.
pub mod tutorial {
    #[doc = include_str!("../../../docs/tutorial/01-from-a-plan-to-an-envelope.md")]
    pub mod t01_from_a_plan_to_an_envelope {}
}
