//! Port: success probabilities of plans.

use elbowroom_num::Rational;

use crate::executor::Mission;
use crate::progression::Progression;

/// Estimates the success probabilities of plans.
pub trait Odds: Send {
    /// Compares the remaining plan with a plan made now; `None` if there is no other plan, or no
    /// estimate.
    fn compare(&mut self, rest: &Remainder<'_>) -> Option<Compared>;
}

/// The remaining part of a plan when no action is running.
#[derive(Clone, Debug)]
pub struct Remainder<'a> {
    /// The plan.
    pub mission: &'a Mission,
    /// The times of its executed time points, on its own clock.
    pub happened: Vec<Option<Rational>>,
    /// The present time, by the world's clock.
    pub now: &'a Rational,
    /// The believed state.
    pub belief: &'a Progression,
}

/// Success probabilities of two plans.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The remaining plan.
    pub present: Rational,
    /// The other plan.
    pub other: Rational,
}
