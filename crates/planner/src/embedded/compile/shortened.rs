//! Actions of which grounding has dropped something that the judge still sees.

use elbowroom_model::Task;
use elbowroom_model::reachability::Grounding;
use elbowroom_model::{ground, problem};

/// In full, as the judge sees them, the actions of which grounding may have dropped something that
/// reads or writes a changing fact: a conditional effect that never happens, or a part of a
/// disjunction that other parts decide. These interfere all the same.
///
/// `None` if `goes_on` says that it shall end.
pub(super) fn full_actions(
    task: &Task,
    grounding: &Grounding,
    goes_on: &mut dyn FnMut() -> bool,
) -> Option<Vec<Option<ground::Action>>> {
    let schemas = &task.problem().schemas;
    let is_shortened: Vec<bool> = schemas.iter().map(may_be_shortened).collect();
    if !is_shortened.contains(&true) {
        return Some(Vec::new());
    }
    grounding
        .actions
        .iter()
        .map(|action| {
            if !is_shortened[action.schema.index()] {
                return Some(None);
            }
            // One with quantifiers can take a millisecond.
            let full = task.instantiate(action.schema, &action.arguments).ok();
            goes_on().then_some(full)
        })
        .collect()
}

fn may_be_shortened(schema: &problem::Schema) -> bool {
    let is_conditional = |effect: &problem::Effect| {
        let guard = &effect.guard;
        !(guard.at_start.is_trivial() && guard.over_all.is_trivial() && guard.now.is_trivial())
    };
    match &schema.body {
        problem::Body::Instantaneous { condition, effects } => {
            !is_conjunction(condition) || effects.iter().any(is_conditional)
        }
        problem::Body::Durative {
            at_start,
            at_end,
            start_effects,
            end_effects,
            continuous,
            ..
        } => {
            let mut effects = start_effects.iter().chain(end_effects);
            !is_conjunction(at_start)
                || !is_conjunction(at_end)
                || effects.any(is_conditional)
                || continuous
                    .iter()
                    .any(|effect| !effect.guard.at_start.is_trivial())
        }
    }
}

/// Whether nothing but constants can be dropped from a condition.
fn is_conjunction(condition: &problem::Condition) -> bool {
    match condition {
        problem::Condition::Atom(_)
        | problem::Condition::Equal(..)
        | problem::Condition::Compare(..) => true,
        problem::Condition::Not(part) => matches!(
            **part,
            problem::Condition::Atom(_) | problem::Condition::Equal(..)
        ),
        problem::Condition::And(parts) => parts.iter().all(is_conjunction),
        problem::Condition::Forall(_, part) => is_conjunction(part),
        problem::Condition::Or(_) | problem::Condition::Exists(..) => false,
    }
}
