//! Whether numbers depend on when things happen.

use elbowroom_model::Situation;
use elbowroom_model::problem::Comparison;
use elbowroom_model::reachability::Grounding;

use super::Compiled;

/// Whether it is plain that no number depends on when things happen: nothing changes continuously,
/// and no duration is chosen.
pub(super) fn has_fixed_numbers(grounding: &Grounding, situation: &Situation) -> bool {
    let running = situation.running.iter().map(|running| &running.action);
    running.chain(&grounding.actions).all(|action| {
        action.durative().is_none_or(|body| {
            let is_fixed = body
                .duration
                .iter()
                .any(|bound| bound.comparison == Comparison::Equal);
            body.continuous.is_empty() && is_fixed
        })
    })
}

/// Whether some number depends on when things happen: on a duration that can be chosen, or on
/// how far a continuous change has come.
pub(super) fn is_symbolic(compiled: &Compiled) -> bool {
    compiled.actions.iter().any(|action| {
        !action.flows.is_empty()
            || action.uses_duration
                && !(action
                    .duration
                    .bounds
                    .iter()
                    .any(|b| b.comparison == Comparison::Equal)
                    || action.duration.most.as_ref() == Some(&action.duration.least))
    })
}
