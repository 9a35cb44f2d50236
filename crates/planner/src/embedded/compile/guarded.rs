//! Variants of actions by the truth of conditions on moving numbers.
//!
//! A number moves if its value depends on the times of happenings. The times, which the search
//! chooses last, decide whether a condition on it holds. So the search chooses the truth, as a
//! condition on the times. An action with a conditional effect has two variants: with the effect
//! and without it. An action with a disjunction has a variant for each alternative.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, Effect, Expression, FluentId, SnapAction,
};
use elbowroom_model::problem::{Comparison, UpdateOperator};
use elbowroom_model::reachability::Grounding;

use crate::embedded::formula::Linear;

/// Maximum number of conditions of one action whose truth is chosen.
const MAX_DECIDED: usize = 4;

/// Returns the fluents whose values may depend on the times of happenings.
pub(super) fn moving_fluents(grounding: &Grounding) -> BTreeSet<FluentId> {
    let mut moving = BTreeSet::new();
    loop {
        let before = moving.len();
        for action in &grounding.actions {
            let duration_is_chosen = has_chosen_duration(action);
            let mut add = |snap: &SnapAction| {
                for effect in &snap.effects {
                    if let Change::Update { fluent, value, .. } = &effect.change
                        && reads_moving_number(value, duration_is_chosen, &moving)
                    {
                        moving.insert(*fluent);
                    }
                }
            };
            match &action.body {
                Body::Instantaneous(snap) => add(snap),
                Body::Durative(body) => {
                    add(&body.start);
                    add(&body.end);
                    moving.extend(body.continuous.iter().map(|effect| effect.fluent));
                }
            }
        }
        if moving.len() == before {
            return moving;
        }
    }
}

/// Returns `true` if an effect multiplies or divides by a moving number, or is not linear in moving numbers.
pub(super) fn has_products(grounding: &Grounding, moving: &BTreeSet<FluentId>) -> bool {
    let is_product = |effect: &Effect| {
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
        reads_moving_number(value, false, moving) && (scales || Linear::of(value).is_none())
    };
    grounding.actions.iter().any(|action| {
        let (first, second) = match &action.body {
            Body::Instantaneous(snap) => (snap.effects.as_slice(), [].as_slice()),
            Body::Durative(body) => (body.start.effects.as_slice(), body.end.effects.as_slice()),
        };
        first.iter().chain(second).any(is_product)
    })
}

fn has_chosen_duration(action: &Action) -> bool {
    let is_fixed = |body: &elbowroom_model::ground::DurativeBody| {
        body.duration.iter().any(|constraint| {
            constraint.comparison == Comparison::Equal
                && matches!(constraint.bound, Expression::Constant(_))
        })
    };
    action.durative().is_some_and(|body| !is_fixed(body))
}

fn reads_moving_number(
    expression: &Expression,
    reads_duration: bool,
    moving: &BTreeSet<FluentId>,
) -> bool {
    let mut moves = false;
    expression.visit_leaves(&mut |leaf| {
        moves |= match leaf {
            Expression::Duration => reads_duration,
            Expression::Fluent(fluent) => moving.contains(fluent),
            _ => false,
        };
    });
    moves
}

/// Time at which a condition is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    Start,
    End,
}

/// Returns the variants of an action by the truth of the conditions of its effects that read moving
/// numbers, or the action itself if it has none.
pub(super) fn variants_by_guards(action: &Action, moving: &BTreeSet<FluentId>) -> Vec<Action> {
    let guards = moving_guards(action, moving);
    let mut variants = vec![action.clone()];
    for (moment, condition) in guards.iter().take(MAX_DECIDED) {
        variants = variants
            .iter()
            .flat_map(|variant| {
                [true, false].map(|truth| with_truth(variant, (*moment, condition), truth))
            })
            .collect();
    }
    variants
}

/// Returns the conditions of effects that read moving numbers.
fn moving_guards(action: &Action, moving: &BTreeSet<FluentId>) -> Vec<(Moment, Condition)> {
    let duration_is_chosen = has_chosen_duration(action);
    let mut found: Vec<(Moment, Condition)> = Vec::new();
    let mut look = |moment: Moment, condition: &Condition| {
        let mut is_moving = false;
        condition.visit_expressions(&mut |expression| {
            is_moving |= reads_moving_number(expression, duration_is_chosen, moving);
        });
        let guard = (moment, condition.clone());
        if is_moving && !found.contains(&guard) {
            found.push(guard);
        }
    };
    match &action.body {
        Body::Instantaneous(snap) => {
            for effect in &snap.effects {
                look(Moment::Start, &effect.guard.now);
            }
        }
        Body::Durative(body) => {
            for effect in &body.start.effects {
                look(Moment::Start, &effect.guard.now);
            }
            for effect in &body.end.effects {
                look(Moment::Start, &effect.guard.at_start);
                look(Moment::End, &effect.guard.now);
            }
            for effect in &body.continuous {
                look(Moment::Start, &effect.guard.at_start);
            }
        }
    }
    found
}

/// Returns the action with a demand that a condition has this truth. Effects under the condition
/// become unconditional, or are removed.
fn with_truth(action: &Action, (moment, condition): (Moment, &Condition), truth: bool) -> Action {
    let settle = |part: &mut Condition| {
        let is_meant = part == condition;
        if is_meant && truth {
            *part = Condition::TRUE;
        }
        truth || !is_meant
    };
    let at_start = |effect: &mut Effect| settle(&mut effect.guard.at_start);
    let now = |effect: &mut Effect| settle(&mut effect.guard.now);
    let demand = |own: &mut Condition| {
        let wanted = if truth {
            condition.clone()
        } else {
            Condition::Not(Box::new(condition.clone()))
        };
        let own = std::mem::replace(own, Condition::TRUE);
        Condition::And(vec![own, wanted])
    };
    let mut action = action.clone();
    match &mut action.body {
        Body::Instantaneous(snap) => {
            snap.effects.retain_mut(now);
            snap.condition = demand(&mut snap.condition);
        }
        Body::Durative(body) => {
            let (start, end) = (Arc::make_mut(&mut body.start), Arc::make_mut(&mut body.end));
            match moment {
                Moment::Start => {
                    start.effects.retain_mut(now);
                    end.effects.retain_mut(at_start);
                    body.continuous
                        .retain_mut(|effect| settle(&mut effect.guard.at_start));
                    start.condition = demand(&mut start.condition);
                }
                Moment::End => {
                    end.effects.retain_mut(now);
                    end.condition = demand(&mut end.condition);
                }
            }
        }
    }
    action
}
