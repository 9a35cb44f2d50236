//! Plans that leave room.
//!
//! In: a task and a time-triggered plan, or an STN plan file. Out: STN plans, their parameters,
//! and what every schedule of such a plan must satisfy.
//!
//! - [`StnPlan`]: action instances, time points, and bounds on their differences.
//! - [`Parameter`], [`ParametrizedPlan`]: which quantities are left open.
//! - [`PartialOrderPlan`]: the orderings without which an action would spoil another.
//! - [`DecoupledEnvelope`]: an interval for each parameter, a box.
//! - [`uncertain`]: the network of a plan, with what the world decides in it.
//! - [`mod@format`]: STN plan files.

mod decoupled;
pub mod deorder;
mod durations;
pub mod format;
pub mod linear;
mod network;
pub mod obligations;
mod parameter;
pub mod parametrize;
pub mod partial_order;
pub mod reduction;
pub mod soundness;
mod stn_plan;
mod suggestion;
#[cfg(test)]
mod testing;
pub mod uncertain;
mod unknowns;

pub use decoupled::DecoupledEnvelope;
pub use network::{Schedule, network_node};
pub use parameter::{Parameter, ParameterId, ParameterKind, ParametrizedPlan, Valuation};
pub use partial_order::{Link, LinkKind, PartialOrderPlan};
pub use stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, Reason, StnPlan};
pub use suggestion::nearest;
