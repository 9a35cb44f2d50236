//! Plans that leave room.
//!
//! In: a task and a time-triggered plan, or an STN plan file. Out: STN plans and their parameters.
//! What every schedule of such a plan must satisfy, and for which values of its parameters it does,
//! is the concern of the crate `elbowroom-envelope`.
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
mod network;
mod parameter;
pub mod parametrize;
pub mod partial_order;
mod stn_plan;
mod suggestion;
#[cfg(test)]
mod testing;
pub mod uncertain;
mod unknowns;

pub use decoupled::{BoxEnd, DecoupledEnvelope, Side};
pub use network::{Schedule, network_node};
pub use parameter::{Parameter, ParameterId, ParameterKind, ParametrizedPlan, Valuation};
pub use partial_order::{Link, LinkKind, PartialOrderPlan};
pub use stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, Reason, StnPlan};
pub use suggestion::nearest;
