//! Plans that leave room.
//!
//! In: a task and a time-triggered plan, or an STN plan file. Out: STN plans, their parameters,
//! and what every schedule of such a plan must satisfy.
//!
//! - [`StnPlan`]: action instances, time points, and bounds on their differences.
//! - [`Parameter`], [`ParametrizedPlan`]: which quantities are left open.
//! - [`DecoupledEnvelope`]: an interval for each parameter, a box.

mod decoupled;
mod parameter;
mod stn_plan;

pub use decoupled::DecoupledEnvelope;
pub use parameter::{Parameter, ParameterId, ParameterKind, ParametrizedPlan, Valuation};
pub use stn_plan::{Bound, Constraint, Instance, InstanceId, Node, NodeId, Reason, StnPlan};
