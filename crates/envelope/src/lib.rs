//! Which deviations a plan survives (paper 1).
//!
//! In: a [`ParametrizedPlan`](elbowroom_plan::ParametrizedPlan). Out: a box of parameter values,
//! the *decoupled envelope*, in which the plan is guaranteed to work.
//!
//! - [`Oracle`]: the exact box check (Algorithm 1's CHECKINENVELOPE).
//! - [`irr`]: Incremental Rectangular Robustification (Algorithm 1), anytime.
//! - [`Objection`]: why a box is not inside, with values and a schedule that show it.

mod branching;
mod cycles;
mod feasibility;
mod frontier;
mod irr;
mod oracle;
mod sharpen;

pub use frontier::Growth;
pub use irr::{IrrRun, Limit, Settings, StopReason, Widening, irr, limits};
pub use oracle::{Objection, Oracle};
pub use sharpen::sharpen;
