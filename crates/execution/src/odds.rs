//! Port: success probabilities of plans.

use elbowroom_num::Rational;

use crate::executor::Mission;
use crate::progression::Progression;

/// Knows how likely plans are to succeed.
pub trait Odds: Send {
    /// Compares the rest of the present plan with a plan made now; `None` where there is no other
    /// plan, or nothing can be said.
    fn compare(&mut self, rest: &Remainder<'_>) -> Option<Compared>;
}

/// The remaining part of a plan when no action is running.
#[derive(Clone, Debug)]
pub struct Remainder<'a> {
    /// The plan.
    pub mission: &'a Mission,
    /// When each of its time points happened, on its own clock.
    pub happened: Vec<Option<Rational>>,
    /// The present time, by the world's clock.
    pub now: &'a Rational,
    /// The believed state.
    pub belief: &'a Progression,
}

/// The probabilities that two plans succeed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compared {
    /// The rest of the present plan.
    pub present: Rational,
    /// The other plan.
    pub other: Rational,
}
