//! Durations that a domain allows.

use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Condition, DurationConstraint, DurativeBody, Expression,
};
use elbowroom_model::problem::Comparison;
use elbowroom_num::{End, Interval, Rational};

/// Returns the durations that all these constraints allow, or `None` if `value` returns no value
/// for an expression in a bound.
pub(crate) fn allowed<'a>(
    constraints: impl IntoIterator<Item = &'a DurationConstraint>,
    value: &mut impl FnMut(&Expression) -> Option<Rational>,
) -> Option<Interval> {
    let mut allowed = Interval::at_least(Rational::ZERO);
    for constraint in constraints {
        let bound = constraint.bound.evaluate(value)?;
        let upto = |upper| Interval {
            lower: End::Infinite,
            upper,
        };
        let from = |lower| Interval {
            lower,
            upper: End::Infinite,
        };
        allowed = allowed.intersection(&match constraint.comparison {
            Comparison::Equal => Interval::point(bound),
            Comparison::AtMost => Interval::at_most(bound),
            Comparison::AtLeast => Interval::at_least(bound),
            Comparison::Less => upto(End::Open(bound)),
            Comparison::Greater => from(End::Open(bound)),
        });
    }
    Some(allowed)
}

/// Returns the action with the bounds on its duration from its conditions, such as `(at start (>=
/// ?duration 5))`, added to those of the domain. Of over-all conditions, only comparisons with
/// numbers count. They are too strict for the duration 0, for which such conditions are vacuous.
#[must_use]
pub fn with_bounds_of_conditions(action: &Arc<Action>) -> Arc<Action> {
    let mut action = Arc::clone(action);
    let bounds = action.durative().map(of_conditions);
    if let Some(bounds) = bounds.filter(|bounds| !bounds.is_empty())
        && let Body::Durative(body) = &mut Arc::make_mut(&mut action).body
    {
        body.duration.extend(bounds);
    }
    action
}

/// Returns the bounds on the duration from conditions.
fn of_conditions(body: &DurativeBody) -> Vec<DurationConstraint> {
    let of = |condition: &Condition, at_end: bool| {
        let conjuncts = condition.conjuncts().into_iter();
        let bounds = conjuncts.filter_map(move |own| bound(own, at_end));
        bounds.collect::<Vec<_>>()
    };
    let mut bounds = of(&body.start.condition, false);
    bounds.extend(of(&body.end.condition, true));
    let over_all = of(&body.over_all, false).into_iter();
    bounds.extend(over_all.filter(|own| matches!(own.bound, Expression::Constant(_))));
    bounds
}

/// Returns the condition as a bound on the duration, if it compares the duration with an
/// expression.
fn bound(condition: &Condition, at_end: bool) -> Option<DurationConstraint> {
    let (comparison, left, right) = match condition {
        Condition::Compare(comparison, left, right) => (*comparison, left, right),
        Condition::Not(part) => match &**part {
            Condition::Compare(comparison, left, right) => (negated(*comparison)?, left, right),
            _ => return None,
        },
        _ => return None,
    };
    let (comparison, bound) = match (left, right) {
        (Expression::Duration, bound) => (comparison, bound),
        (bound, Expression::Duration) => (mirrored(comparison), bound),
        _ => return None,
    };
    let mut is_of_state = true;
    bound.visit_leaves(&mut |leaf| {
        is_of_state &= matches!(leaf, Expression::Constant(_) | Expression::Fluent(_));
    });
    is_of_state.then(|| DurationConstraint {
        comparison,
        bound: bound.clone(),
        at_end,
    })
}

/// Returns the comparison that holds when this one does not.
fn negated(comparison: Comparison) -> Option<Comparison> {
    match comparison {
        Comparison::Equal => None,
        Comparison::AtMost => Some(Comparison::Greater),
        Comparison::AtLeast => Some(Comparison::Less),
        Comparison::Less => Some(Comparison::AtLeast),
        Comparison::Greater => Some(Comparison::AtMost),
    }
}

/// Returns the same comparison with its sides exchanged.
fn mirrored(comparison: Comparison) -> Comparison {
    match comparison {
        Comparison::Equal => Comparison::Equal,
        Comparison::AtMost => Comparison::AtLeast,
        Comparison::AtLeast => Comparison::AtMost,
        Comparison::Less => Comparison::Greater,
        Comparison::Greater => Comparison::Less,
    }
}
