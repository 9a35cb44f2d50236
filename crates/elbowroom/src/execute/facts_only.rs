//! Actions as a dispatcher sees them that knows no numbers, or no durations but the planned ones.

use std::sync::Arc;

use elbowroom_model::ground::{Action, Body, Change, Condition, Effect, Expression, SnapAction};
use elbowroom_model::{Step, TimeTriggeredPlan};

/// The plan without conditions and effects on numbers: what `ROSPlan` orders happenings by.
pub(super) fn facts_only(plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
    let steps = plan.steps.iter().map(|step| Step {
        action: Arc::new(without_numbers(&step.action)),
        ..step.clone()
    });
    TimeTriggeredPlan {
        steps: steps.collect(),
    }
}

fn without_numbers(action: &Action) -> Action {
    let mut action = action.clone();
    match &mut action.body {
        Body::Instantaneous(snap) => strip(snap),
        Body::Durative(body) => {
            strip(Arc::make_mut(&mut body.start));
            strip(Arc::make_mut(&mut body.end));
            body.over_all = taken_as(&body.over_all, true);
            body.continuous.clear();
        }
    }
    action
}

fn strip(snap: &mut SnapAction) {
    snap.condition = taken_as(&snap.condition, true);
    let is_number = |effect: &Effect| matches!(effect.change, Change::Update { .. });
    snap.effects.retain(|effect| !is_number(effect));
}

/// The condition with its comparisons taken for fulfilled; below a negation, for not fulfilled.
fn taken_as(condition: &Condition, truth: bool) -> Condition {
    match condition {
        Condition::Fact(fact) => Condition::Fact(*fact),
        Condition::Compare(..) if truth => Condition::TRUE,
        Condition::Compare(..) => Condition::FALSE,
        Condition::Not(part) => Condition::Not(Box::new(taken_as(part, !truth))),
        Condition::And(parts) => {
            Condition::And(parts.iter().map(|it| taken_as(it, truth)).collect())
        }
        Condition::Or(parts) => Condition::Or(parts.iter().map(|it| taken_as(it, truth)).collect()),
    }
}

/// The plan with each planned duration in place of `?duration`: numbers that depend on how long
/// something takes are followed as if all went as planned.
pub(crate) fn as_timed(plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
    TimeTriggeredPlan {
        steps: plan.steps.iter().map(timed).collect(),
    }
}

fn timed(step: &Step) -> Step {
    let duration = step.duration.clone();
    let mut planned = |leaf: &Expression| match leaf {
        Expression::Duration => duration.clone().map(Expression::Constant),
        _ => None,
    };
    Step {
        action: Arc::new(step.action.map_leaves(&mut planned)),
        ..step.clone()
    }
}
