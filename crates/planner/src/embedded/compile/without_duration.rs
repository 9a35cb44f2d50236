//! Durative actions whose duration may be 0.
//!
//! With that duration there is no moment between start and end, so the over-all condition is
//! vacuous, and the conditions at start and at end read the same state. Such an instance happens at
//! one moment like an instantaneous action. It exists only if its start does not interfere with its
//! end.

use elbowroom_model::ground::{self, Condition, Effect, Expression, Guard, SnapAction};
use elbowroom_model::problem::Comparison;
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;

/// Returns `true` if the action has an over-all condition, and no duration but 0.
pub(super) fn takes_no_time(action: &ground::Action) -> bool {
    let is_zero = |constraint: &ground::DurationConstraint| {
        let is_upper = matches!(
            constraint.comparison,
            Comparison::Equal | Comparison::AtMost
        );
        is_upper && matches!(&constraint.bound, Expression::Constant(bound) if bound.is_zero())
    };
    action
        .durative()
        .is_some_and(|body| !body.over_all.is_trivial() && body.duration.iter().any(is_zero))
}

/// Returns the single happening of an action with duration 0. Returns `None` if its duration cannot
/// be 0, if its start interferes with its end, or if it has no over-all condition, so that the
/// durative form loses nothing. `full` is the action with all parts that the validator uses, if
/// grounding has removed some.
pub(super) fn without_duration(
    task: &Task,
    action: &ground::Action,
    full: Option<&ground::Action>,
) -> Option<SnapAction> {
    let body = action.durative()?;
    if body.over_all.is_trivial() || !body.may_take_no_time() {
        return None;
    }
    let full = full.unwrap_or(action);
    let start = Footprint::of_start(task, full);
    if start.interferes_with(&Footprint::of_end(task, full)) {
        return None;
    }
    let zero = |leaf: &Expression| {
        (*leaf == Expression::Duration).then_some(Expression::Constant(Rational::ZERO))
    };
    let action = action.map_leaves(&mut { zero });
    let body = action.durative()?;
    let mut conditions = vec![body.start.condition.clone(), body.end.condition.clone()];
    let bounds = body.duration.iter();
    conditions.extend(bounds.map(|constraint| {
        let zero = Expression::Constant(Rational::ZERO);
        Condition::Compare(constraint.comparison, zero, constraint.bound.clone())
    }));
    let effects = body.start.effects.iter().chain(&body.end.effects);
    let effects = effects.map(|effect| Effect {
        guard: Guard {
            now: Condition::And(vec![
                effect.guard.at_start.clone(),
                effect.guard.now.clone(),
            ]),
            ..Guard::ALWAYS
        },
        change: effect.change.clone(),
    });
    let effects = effects.map(|mut effect| {
        if effect.guard.now.conjuncts().is_empty() {
            effect.guard = Guard::ALWAYS;
        }
        effect
    });
    Some(SnapAction {
        condition: Condition::And(conditions),
        effects: effects.collect(),
    })
}
