//! Actions as a dispatcher sees them that knows no numbers.

use elbowroom_model::ground::{Action, Body, Change, Condition, Effect, SnapAction};
use elbowroom_model::{Step, TimeTriggeredPlan};

/// The plan without conditions and effects on numbers, steps in order of start: what `ROSPlan`
/// orders happenings by.
pub(super) fn facts_only(plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
    let steps = sorted(plan).into_iter().map(|step| Step {
        action: without_numbers(&step.action),
        ..step
    });
    TimeTriggeredPlan {
        steps: steps.collect(),
    }
}

/// The steps in the order in which deordering numbers them.
pub(super) fn sorted(plan: &TimeTriggeredPlan) -> Vec<Step> {
    let mut steps = plan.steps.clone();
    steps.sort_by(|a, b| a.start.cmp(&b.start));
    steps
}

fn without_numbers(action: &Action) -> Action {
    let mut action = action.clone();
    match &mut action.body {
        Body::Instantaneous(snap) => strip(snap),
        Body::Durative(body) => {
            strip(&mut body.start);
            strip(&mut body.end);
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
