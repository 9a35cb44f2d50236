//! Dependence of numbers on the times of happenings.

use elbowroom_model::ground;
use elbowroom_model::problem::Comparison;
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{RunningAction, Situation};
use elbowroom_num::{End, Rational};

use super::Action;
use super::builder::reads_duration;

/// Returns `true` if clearly no number depends on the times of happenings: no continuous effects,
/// and no durations to choose.
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
    // The situation, not the domain, gives the duration of a running action.
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

/// Returns the duration of a running action, if it is certain.
pub(super) fn known_duration(running: &RunningAction) -> Option<&Rational> {
    match (&running.duration.lower, &running.duration.upper) {
        (End::Closed(least), End::Closed(most)) => (least == most).then_some(least),
        _ => None,
    }
}

/// Returns `true` if some number depends on the times of happenings: on a duration that can be
/// chosen, or on the progress of a continuous change.
pub(super) fn is_symbolic(actions: &[Action], situation: &Situation) -> bool {
    // Running actions come first.
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
