//! Constants in a ground action: their occurrences, and their replacement by parameters.

use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Action, Body, Change, Condition, Effect, Expression, FluentId, SnapAction,
};
use elbowroom_model::problem::{self, FunctionId, Unknown};
use elbowroom_num::Rational;

use crate::valuation::ParameterId;

/// Expressions of an action to search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Place {
    /// Amounts of effects, including continuous ones, on the function, or values assigned to it.
    Effects(FunctionId),
    /// Comparisons that read the function.
    Conditions(FunctionId),
}

/// Returns the distinct constants at this place of an action, in ascending order.
pub(super) fn constants(task: &Task, action: &Action, place: Place) -> Vec<Rational> {
    let mut found = Vec::new();
    let _ = rewritten(task, action, place, &mut |leaf| {
        if let Expression::Constant(value) = leaf {
            found.push(value.clone());
        }
        None
    });
    found.sort();
    found.dedup();
    found
}

/// Returns the fluents that are read at this place of an action.
pub(super) fn fluents(task: &Task, action: &Action, place: Place) -> Vec<FluentId> {
    let mut found = Vec::new();
    let _ = rewritten(task, action, place, &mut |leaf| {
        if let Expression::Fluent(fluent) = leaf {
            found.push(*fluent);
        }
        None
    });
    found.sort();
    found.dedup();
    found
}

/// Returns the action with the parameter in place of the constant at this place.
pub(super) fn with_parameter(
    task: &Task,
    action: &Action,
    place: Place,
    constant: &Rational,
    id: ParameterId,
) -> Action {
    rewritten(task, action, place, &mut |leaf| match leaf {
        Expression::Constant(value) if value == constant => {
            Some(Expression::Unknown(Unknown::Parameter(id.0)))
        }
        _ => None,
    })
}

type Replace<'a> = &'a mut dyn FnMut(&Expression) -> Option<Expression>;

fn rewritten(task: &Task, action: &Action, place: Place, replace: Replace<'_>) -> Action {
    let mut action = action.clone();
    match &mut action.body {
        Body::Instantaneous(snap) => rewrite_snap(task, snap, place, replace),
        Body::Durative(body) => {
            rewrite_snap(task, Arc::make_mut(&mut body.start), place, replace);
            rewrite_snap(task, Arc::make_mut(&mut body.end), place, replace);
            match place {
                Place::Conditions(function) => {
                    rewrite_condition(task, &mut body.over_all, function, replace);
                }
                Place::Effects(function) => {
                    let is_decrease = only_decreases(task, action.schema, function);
                    for effect in &mut body.continuous {
                        if task.function_of(effect.fluent) == function {
                            effect.rate = rewrite_rate(&effect.rate, is_decrease, replace);
                        }
                    }
                }
            }
        }
    }
    action
}

/// Returns `true` if the action changes the function continuously and all these changes are written
/// as decreases: `(decrease (charge) (* #t 2))`.
fn only_decreases(task: &Task, schema: problem::SchemaId, function: FunctionId) -> bool {
    let problem::Body::Durative { continuous, .. } = &task.problem().schemas[schema.index()].body
    else {
        return false;
    };
    let mut own = continuous
        .iter()
        .filter(|effect| effect.fluent.function == function)
        .peekable();
    own.peek().is_some() && own.all(|effect| matches!(effect.rate, problem::Expression::Negate(_)))
}

/// Replaces numbers in a rate. Those of a decrease are the numbers in the domain, without the sign
/// of the rate.
fn rewrite_rate(rate: &Expression, is_decrease: bool, replace: Replace<'_>) -> Expression {
    if !is_decrease {
        return rate.map_leaves(&mut |leaf| replace(leaf));
    }
    negated(&negated(rate).map_leaves(&mut |leaf| replace(leaf)))
}

fn negated(expression: &Expression) -> Expression {
    match expression {
        Expression::Constant(value) => Expression::Constant(-value),
        Expression::Negate(part) => (**part).clone(),
        _ => Expression::Negate(Box::new(expression.clone())),
    }
}

fn rewrite_snap(task: &Task, snap: &mut SnapAction, place: Place, replace: Replace<'_>) {
    match place {
        Place::Conditions(function) => {
            rewrite_condition(task, &mut snap.condition, function, replace);
        }
        Place::Effects(function) => {
            for effect in &mut snap.effects {
                rewrite_effect(task, effect, function, replace);
            }
        }
    }
}

fn rewrite_effect(task: &Task, effect: &mut Effect, function: FunctionId, replace: Replace<'_>) {
    if let Change::Update { fluent, value, .. } = &mut effect.change
        && task.function_of(*fluent) == function
    {
        *value = value.map_leaves(&mut |leaf| replace(leaf));
    }
}

fn rewrite_condition(
    task: &Task,
    condition: &mut Condition,
    function: FunctionId,
    replace: Replace<'_>,
) {
    match condition {
        Condition::Fact(_) => {}
        Condition::Compare(_, left, right) => {
            let mut reads = false;
            for side in [&*left, &*right] {
                side.visit_fluents(&mut |fluent| reads |= task.function_of(fluent) == function);
            }
            if reads {
                for side in [left, right] {
                    *side = side.map_leaves(&mut |leaf| replace(leaf));
                }
            }
        }
        Condition::Not(part) => rewrite_condition(task, part, function, replace),
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                rewrite_condition(task, part, function, replace);
            }
        }
    }
}
