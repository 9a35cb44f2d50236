//! The numbers in a problem: every place for a parameter.

use elbowroom_model::Problem;
use elbowroom_model::problem::{Body, Change, Condition, Effect, Expression, Unknown};
use elbowroom_num::Rational;

/// Calls `visit` for each constant and each unknown in the actions and the goal.
pub(crate) fn visit(problem: &mut Problem, visit: &mut dyn FnMut(&mut Expression)) {
    for schema in &mut problem.schemas {
        match &mut schema.body {
            Body::Instantaneous { condition, effects } => {
                in_condition(condition, visit);
                in_effects(effects, visit);
            }
            Body::Durative {
                duration,
                at_start,
                over_all,
                at_end,
                start_effects,
                end_effects,
                continuous,
            } => {
                for constraint in duration {
                    in_expression(&mut constraint.bound, visit);
                }
                for condition in [at_start, over_all, at_end] {
                    in_condition(condition, visit);
                }
                in_effects(start_effects, visit);
                in_effects(end_effects, visit);
                for effect in continuous {
                    in_condition(&mut effect.guard.at_start, visit);
                    in_expression(&mut effect.rate, visit);
                }
            }
        }
    }
    in_condition(&mut problem.goal, visit);
}

/// Replaces the domain's unknowns by values.
pub(crate) fn fill(problem: &mut Problem, values: &dyn Fn(usize) -> Option<Rational>) {
    visit(problem, &mut |leaf| {
        if let Expression::Unknown(Unknown::Domain(index)) = leaf
            && let Some(value) = values(*index as usize)
        {
            *leaf = Expression::Constant(value);
        }
    });
}

fn in_effects(effects: &mut [Effect], visit: &mut dyn FnMut(&mut Expression)) {
    for effect in effects {
        in_condition(&mut effect.guard.at_start, visit);
        in_condition(&mut effect.guard.now, visit);
        if let Change::Update { value, .. } = &mut effect.change {
            in_expression(value, visit);
        }
    }
}

fn in_condition(condition: &mut Condition, visit: &mut dyn FnMut(&mut Expression)) {
    match condition {
        Condition::Compare(_, left, right) => {
            in_expression(left, visit);
            in_expression(right, visit);
        }
        Condition::Not(part) | Condition::Forall(_, part) | Condition::Exists(_, part) => {
            in_condition(part, visit);
        }
        Condition::And(parts) | Condition::Or(parts) => {
            for part in parts {
                in_condition(part, visit);
            }
        }
        Condition::Atom(_) | Condition::Equal(..) => {}
    }
}

fn in_expression(expression: &mut Expression, visit: &mut dyn FnMut(&mut Expression)) {
    match expression {
        Expression::Constant(_) | Expression::Unknown(_) => visit(expression),
        Expression::Fluent(_)
        | Expression::Duration
        | Expression::TotalTime
        | Expression::Violations(_) => {}
        Expression::Add(parts) | Expression::Multiply(parts) => {
            for part in parts {
                in_expression(part, visit);
            }
        }
        Expression::Subtract(left, right) | Expression::Divide(left, right) => {
            in_expression(left, visit);
            in_expression(right, visit);
        }
        Expression::Negate(part) => in_expression(part, visit),
    }
}
