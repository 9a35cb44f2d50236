//! Reasons why a box is not inside an envelope: [`Objection`].

use elbowroom_plan::Valuation;

use crate::control::ControlConflict;
use crate::soundness::Broken;

/// Reason why a box is not inside the envelope.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Objection {
    /// For these values of the parameters the plan has no schedule.
    #[error("for some values in the box the plan has no schedule")]
    NoSchedule(Valuation),
    /// For some values, some schedule violates an obligation.
    #[error("for some values in the box the plan has an invalid schedule")]
    Broken(Broken),
    /// There is a schedule for all values, but it depends on values that are not known in time.
    #[error("{0}")]
    Uncontrollable(ControlConflict),
}
