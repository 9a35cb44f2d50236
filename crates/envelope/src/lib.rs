//! Which deviations a plan survives (paper 1).
//!
//! In: a [`ParametrizedPlan`](elbowroom_plan::ParametrizedPlan). Out: a box of parameter values,
//! the *decoupled envelope*, in which the plan is guaranteed to work.
//!
//! - [`mod@obligations`]: what every schedule of a plan must satisfy.
//! - [`mod@soundness`]: whether every schedule for every value in a box satisfies it.
//! - [`Guarantee`]: what else is asked of a box: that the plan can be scheduled, and by whom.
//! - [`Oracle`]: the exact box check (Algorithm 1's CHECKINENVELOPE), both together.
//! - [`irr`]: Incremental Rectangular Robustification (Algorithm 1), anytime.
//! - [`Objection`]: why a box is not inside, with values and a schedule that show it.
//!
//! Only crates that may ask a solver can import this one: linear programs and minimum cost flows
//! are solved here, and nothing that decides while a plan is executed depends on them.

mod branching;
mod control;
mod cycles;
mod enforce;
mod feasibility;
mod frontier;
mod guarantee;
mod irr;
pub mod linear;
mod method;
pub mod obligations;
mod oracle;
pub mod reduction;
mod sharpen;
pub mod soundness;

pub use control::{ControlConflict, ControlGround};
pub use enforce::enforced;
pub use frontier::Growth;
pub use guarantee::Guarantee;
pub use irr::{IrrRun, Limit, Settings, StopReason, Widening, irr, limits};
pub use method::Method;
pub use oracle::{Objection, Oracle};
pub use sharpen::sharpen;
