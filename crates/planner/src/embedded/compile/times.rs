//! Whether numbers depend on when things happen.

use elbowroom_model::ground;
use elbowroom_model::problem::Comparison;
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{RunningAction, Situation};
use elbowroom_num::{End, Rational};

use super::Action;
use super::builder::reads_duration;

/// Whether it is plain that no number depends on when things happen: nothing changes continuously,
/// and no duration is chosen.
pub(super) fn has_fixed_numbers(grounding: &Grounding, situation: &Situation) -> bool {
    let fixed = |action: &ground::Action| {
        action.durative().is_none_or(|body| {
            let is_fixed = body
                .duration
                .iter()
                .any(|bound| bound.comparison == Comparison::Equal);
            body.continuous.is_empty() && is_fixed
        })
    };
    // How long something takes that is under way is for the situation to say, not for the domain.
    let certain = |running: &RunningAction| {
        let body = running.action.durative();
        known_duration(running).is_some() || !body.is_some_and(reads_duration)
    };
    grounding.actions.iter().all(fixed)
        && situation
            .running
            .iter()
            .all(|running| fixed(&running.action) && certain(running))
}

/// The duration of a running action, if it is certain.
pub(super) fn known_duration(running: &RunningAction) -> Option<&Rational> {
    match (&running.duration.lower, &running.duration.upper) {
        (End::Closed(least), End::Closed(most)) => (least == most).then_some(least),
        _ => None,
    }
}

/// Whether some number depends on when things happen: on a duration that can be chosen, or on
/// how far a continuous change has come.
pub(super) fn is_symbolic(actions: &[Action], situation: &Situation) -> bool {
    // Those under way come first.
    let under_way = situation.running.iter().map(Some);
    let running = under_way.chain(std::iter::repeat(None));
    actions.iter().zip(running).any(|(action, running)| {
        let is_chosen = || {
            if let Some(running) = running {
                return known_duration(running).is_none();
            }
            let mut bounds = action.duration.bounds.iter();
            !bounds.any(|b| b.comparison == Comparison::Equal)
                && action.duration.most.as_ref() != Some(&action.duration.least)
        };
        !action.flows.is_empty() || action.uses_duration && is_chosen()
    })
}
