//! Port: success probabilities of plans.

use elbowroom_num::Rational;

use crate::belief_state::BeliefState;
use crate::executor::PreparedPlan;

/// Estimates the success probabilities of plans.
pub trait PlanComparator: Send {
    /// Compares the remaining plan with a plan made now; `None` if there is no other plan, or no
    /// estimate.
    fn compare(&mut self, rest: &RemainingPlan<'_>) -> Option<SuccessRates>;
}

/// The remaining part of a plan when no action is running.
#[derive(Clone, Debug)]
pub struct RemainingPlan<'a> {
    /// The plan.
    pub prepared_plan: &'a PreparedPlan,
    /// The times of its executed time points, on its own clock.
    pub happened: Vec<Option<Rational>>,
    /// The present time, by the world's clock.
    pub now: &'a Rational,
    /// The believed state.
    pub belief: &'a BeliefState,
}

/// Success probabilities of two plans.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SuccessRates {
    /// The remaining plan.
    pub remaining_plan: Rational,
    /// The other plan.
    pub other_plan: Rational,
}
