//! Variants of actions with a fixed duration, for numbers that are not linear in the duration.
//!
//! The search represents numbers as linear expressions of times. A product of `?duration` and
//! another number is not linear, unless the duration is a constant. If the duration can be chosen,
//! a few constants are tried in addition to the whole interval.

use elbowroom_model::ground::{
    Action, Body, Change, DurationConstraint, Effect, Expression, FluentId, SnapAction,
};
use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_num::Rational;

use super::builder;
use crate::embedded::formula::Linear;

/// Returns `true` if the search cannot apply the action unless its duration is fixed: an effect on
/// a fluent that matters always takes place, and is not linear in a duration that can be chosen.
pub(super) fn needs_fixed_duration(action: &Action, matters: &dyn Fn(FluentId) -> bool) -> bool {
    let fails = |effect: &Effect| {
        let writes = match &effect.change {
            Change::Update { fluent, .. } => matters(*fluent),
            _ => false,
        };
        writes && effect.guard.is_trivial() && is_nonlinear_effect(effect)
    };
    action.durative().is_some_and(|body| {
        let is_fixed = |constraint: &DurationConstraint| constraint.comparison == Comparison::Equal;
        !body.duration.iter().any(is_fixed)
            && [&body.start, &body.end]
                .into_iter()
                .any(|snap| snap.effects.iter().any(fails))
    })
}

/// Returns the action with each duration that needs a variant, or no actions if all numbers are
/// linear in the duration.
///
/// `has_products` is `true` if some effect multiplies numbers that depend on times. Then all
/// dependences of such a number on the duration need variants.
pub(super) fn variants_with_fixed_duration(action: &Action, has_products: bool) -> Vec<Action> {
    let Some(body) = action.durative() else {
        return Vec::new();
    };
    let snaps = [&body.start, &body.end];
    let matters = has_products && (!body.continuous.is_empty() || builder::reads_duration(body));
    if !matters && !snaps.into_iter().any(|snap| is_nonlinear(snap)) {
        return Vec::new();
    }
    let mut least = Rational::ZERO;
    let mut most: Option<Rational> = None;
    for constraint in &body.duration {
        let Expression::Constant(bound) = &constraint.bound else {
            continue;
        };
        let comparison = constraint.comparison;
        if comparison == Comparison::Equal {
            return Vec::new();
        }
        if matches!(comparison, Comparison::AtLeast | Comparison::Greater) {
            least = least.max(bound.clone());
        } else {
            let lower = most.filter(|most| most < bound);
            most = Some(lower.unwrap_or_else(|| bound.clone()));
        }
    }
    let middle = most
        .as_ref()
        .map(|most| (&least + most) / Rational::from(2));
    let mut durations = vec![least, Rational::ONE];
    durations.extend(middle.into_iter().chain(most));
    durations.sort();
    durations.dedup();
    let is_allowed = |duration: &Rational| {
        body.duration
            .iter()
            .all(|constraint| match &constraint.bound {
                Expression::Constant(bound) => constraint.comparison.holds(duration, bound),
                _ => true,
            })
    };
    let durations = durations.into_iter().filter(is_allowed);
    let variants = durations.map(|duration| {
        let mut variant = action.clone();
        if let Body::Durative(body) = &mut variant.body {
            body.duration.push(DurationConstraint {
                comparison: Comparison::Equal,
                bound: Expression::Constant(duration),
                at_end: false,
            });
        }
        variant
    });
    variants.collect()
}

fn reads_duration(expression: &Expression) -> bool {
    let mut reads = false;
    expression.visit_leaves(&mut |leaf| reads |= *leaf == Expression::Duration);
    reads
}

fn is_nonlinear_effect(effect: &Effect) -> bool {
    let Change::Update {
        operator, value, ..
    } = &effect.change
    else {
        return false;
    };
    let scales = matches!(
        operator,
        UpdateOperator::ScaleUp | UpdateOperator::ScaleDown
    );
    reads_duration(value) && (scales || Linear::of(value).is_none())
}

fn is_nonlinear(snap: &SnapAction) -> bool {
    let mut is_nonlinear = snap.effects.iter().any(is_nonlinear_effect);
    snap.condition.visit_expressions(&mut |expression| {
        is_nonlinear |= reads_duration(expression) && Linear::of(expression).is_none();
    });
    is_nonlinear
}
