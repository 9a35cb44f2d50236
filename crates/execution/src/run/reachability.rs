//! Parts of the goal that can never become true any more.
//!
//! [`reachability`] computes an upper bound on the facts that can become true, ignoring deletions
//! and time. No plan can reach anything else.

use elbowroom_model::ground::Condition;
use elbowroom_model::{Task, reachability};

use super::situation::{OverrunEstimate, situation_at};
use crate::belief_state::BeliefState;

/// Limit on the work of reachability for an explanation: about a second.
pub(super) const MAX_STEPS: u64 = 10_000_000;

/// The same limit for [`is_goal_unreachable`], which delays the run: about a tenth of a second.
const MAX_STEPS_DURING_RUN: u64 = 1_000_000;

/// Returns `true` if part of the goal can never become true any more, and `false` if that cannot be
/// decided within a small limit.
pub(super) fn is_goal_unreachable(state: &BeliefState) -> bool {
    unreachable(state, MAX_STEPS_DURING_RUN).is_some_and(|lost| !lost.is_empty())
}

/// Returns the parts of the goal that can never become true any more, as far as that can be decided
/// within a small limit.
pub(super) fn unreachable_conditions(state: &BeliefState) -> Vec<Condition> {
    unreachable(state, MAX_STEPS_DURING_RUN).unwrap_or_default()
}

/// Returns the unreachable parts of the goal, if they can be computed within the limit.
pub(super) fn unreachable(state: &BeliefState, step_limit: u64) -> Option<Vec<Condition>> {
    // A late action may still end.
    let soon = OverrunEstimate::AsSoonAsPossible;
    let (situation, _) = situation_at(state, state.time().clone(), soon);
    let task = Task::starting_from(state.task(), &situation);
    let settings = reachability::Settings {
        step_limit,
        ..reachability::Settings::default()
    };
    match reachability::ground(&task, &settings) {
        reachability::Answer::Complete(grounding) => Some(grounding.unreachable_goals),
        reachability::Answer::LimitReached => None,
    }
}
