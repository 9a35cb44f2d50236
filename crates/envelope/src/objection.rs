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
    /// For some values, some schedule breaks an obligation.
    #[error("for some values in the box a schedule breaks the plan")]
    Broken(Broken),
    /// For all values there is a schedule, but one that has to be known sooner than the values are.
    #[error("{0}")]
    Uncontrollable(ControlConflict),
}
