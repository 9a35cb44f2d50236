//! Flexible plans: STN plans, their parameters, and boxes of parameter values.
//!
//! Input: a task and a time-triggered plan, or an STN plan file. Output: STN plans and their
//! parameters. The crate `elbowroom-envelope` computes the parameter values for which such a plan
//! works.
//!
//! - [`StnPlan`]: action instances, time points, and bounds on their differences.
//! - [`Parameter`], [`ParametrizedPlan`]: the uncertain quantities of a plan.
//! - [`PartialOrderPlan`]: the orderings between interfering happenings.
//! - [`DecoupledEnvelope`]: an interval for each parameter, a box.
//! - [`uncertain`]: the network of a plan as an STNU, with contingent links.
//! - [`mod@format`]: STN plan files.
//!
//! ```
//! use elbowroom_model::problem::{Body, Condition, Schema};
//! use elbowroom_model::{Problem, Task};
//! use elbowroom_plan::format;
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
//! let text = "
//!     parameter latest default 3;
//!     action instance b : (beep);
//!     c: b - .zero in [1, latest];";
//! let plan = format::read(text, &task)?;
//! assert_eq!(plan.parameters[0].name, "latest");
//!
//! let mistaken = format::read("action instance b : (bep);", &task).unwrap_err();
//! assert_eq!(
//!     mistaken.to_string(),
//!     "text:1:22: error: the domain has no action `bep`; did you mean `beep`?"
//! );
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod box_text;
mod decoupled_envelope;
pub mod deorder;
pub mod dot;
mod durations;
pub mod format;
pub mod makespan;
mod network;
mod numbers;
mod parameter;
pub mod parametrize;
pub mod partial_order;
mod plan_file;
mod stn_plan;
#[cfg(test)]
mod testing;
pub mod uncertain;
mod unknowns;
mod valuation;

pub use decoupled_envelope::{BoxEnd, DecoupledEnvelope};
pub use durations::with_bounds_of_conditions;
pub use elbowroom_num::Side;
pub use network::{Origin, Schedule, network_node};
pub use parameter::{Parameter, ParameterKind, ParametrizedPlan};
pub use partial_order::{Link, LinkKind, PartialOrderPlan};
pub use plan_file::{AnyPlan, PlanKind};
pub use stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, Reason, StnPlan};
pub use valuation::{ParameterId, Valuation};
