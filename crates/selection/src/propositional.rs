//! Plans for dispatchers without numbers, or with planned durations only.

use std::collections::BTreeSet;
use std::sync::Arc;

use elbowroom_model::ground::{
    Action, Body, Change, Condition, Effect, Expression, FluentId, Guard, SnapAction,
};
use elbowroom_model::{Step, Task, TimeTriggeredPlan};
use elbowroom_plan::with_bounds_of_conditions;

/// Returns the plan without conditions on numbers, and without effects on numbers that affect
/// neither durations nor facts. `ROSPlan` orders happenings in the same way.
pub(super) fn to_propositional(task: &Task, plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
    let actions = plan
        .steps
        .iter()
        .map(|step| without_conditions(&step.action));
    let mut actions: Vec<Action> = actions.collect();
    let deciding = relevant_fluents(task, &actions);
    for action in &mut actions {
        match &mut action.body {
            Body::Instantaneous(snap) => remove_irrelevant_effects(snap, &deciding),
            Body::Durative(body) => {
                remove_irrelevant_effects(Arc::make_mut(&mut body.start), &deciding);
                remove_irrelevant_effects(Arc::make_mut(&mut body.end), &deciding);
                body.continuous.retain(|it| deciding.contains(&it.fluent));
            }
        }
    }
    let steps = plan.steps.iter().zip(actions).map(|(step, action)| Step {
        action: Arc::new(action),
        ..step.clone()
    });
    TimeTriggeredPlan {
        steps: steps.collect(),
    }
}

/// Returns the fluents that affect durations and facts: durations, guards of effects on facts, and
/// derived facts read them, or other such fluents are computed from them.
fn relevant_fluents(task: &Task, actions: &[Action]) -> BTreeSet<FluentId> {
    let mut deciding = BTreeSet::new();
    loop {
        let before = deciding.len();
        for action in actions {
            let mut read = BTreeSet::new();
            let snap = |snap: &SnapAction, read: &mut BTreeSet<FluentId>| {
                collect_fluents(task, &snap.condition, read);
                for effect in &snap.effects {
                    if let Change::Update { fluent, value, .. } = &effect.change {
                        if !deciding.contains(fluent) {
                            continue;
                        }
                        value.visit_fluents(&mut |fluent| {
                            read.insert(fluent);
                        });
                    }
                    collect_guard_fluents(task, &effect.guard, read);
                }
            };
            match &action.body {
                Body::Instantaneous(only) => snap(only, &mut read),
                Body::Durative(body) => {
                    snap(&body.start, &mut read);
                    snap(&body.end, &mut read);
                    collect_fluents(task, &body.over_all, &mut read);
                    let bounds = body.duration.iter().map(|it| &it.bound);
                    let running = body.continuous.iter();
                    let running = running.filter(|it| deciding.contains(&it.fluent));
                    for effect in running.clone() {
                        collect_guard_fluents(task, &effect.guard, &mut read);
                    }
                    for number in bounds.chain(running.map(|it| &it.rate)) {
                        number.visit_fluents(&mut |fluent| {
                            read.insert(fluent);
                        });
                    }
                }
            }
            deciding.extend(read);
        }
        if deciding.len() == before {
            return deciding;
        }
    }
}

/// Adds the fluents that a condition reads, directly or through derived predicates.
fn collect_fluents(task: &Task, condition: &Condition, read: &mut BTreeSet<FluentId>) {
    task.visit_fluents_of(condition, &mut |fluent| {
        read.insert(fluent);
    });
}

fn collect_guard_fluents(task: &Task, guard: &Guard, read: &mut BTreeSet<FluentId>) {
    for condition in [&guard.at_start, &guard.over_all, &guard.now] {
        collect_fluents(task, condition, read);
    }
}

/// Returns the action with its comparisons assumed true.
fn without_conditions(action: &Action) -> Action {
    let mut action = action.clone();
    let without =
        |snap: &mut SnapAction| snap.condition = assume_comparisons(&snap.condition, true);
    match &mut action.body {
        Body::Instantaneous(snap) => without(snap),
        Body::Durative(body) => {
            without(Arc::make_mut(&mut body.start));
            without(Arc::make_mut(&mut body.end));
            body.over_all = assume_comparisons(&body.over_all, true);
        }
    }
    action
}

/// Removes effects on fluents outside `deciding`.
fn remove_irrelevant_effects(snap: &mut SnapAction, deciding: &BTreeSet<FluentId>) {
    let is_kept = |effect: &Effect| match &effect.change {
        Change::Update { fluent, .. } => deciding.contains(fluent),
        Change::Add(_) | Change::Delete(_) => true,
    };
    snap.effects.retain(is_kept);
}

/// Returns the condition with its comparisons assumed true; below a negation, false.
fn assume_comparisons(condition: &Condition, truth: bool) -> Condition {
    match condition {
        Condition::Fact(fact) => Condition::Fact(*fact),
        Condition::Compare(..) if truth => Condition::TRUE,
        Condition::Compare(..) => Condition::FALSE,
        Condition::Not(part) => Condition::Not(Box::new(assume_comparisons(part, !truth))),
        Condition::And(parts) => Condition::And(
            parts
                .iter()
                .map(|it| assume_comparisons(it, truth))
                .collect(),
        ),
        Condition::Or(parts) => Condition::Or(
            parts
                .iter()
                .map(|it| assume_comparisons(it, truth))
                .collect(),
        ),
    }
}

/// Returns the plan with each planned duration in place of `?duration`: numbers that depend on
/// durations are computed as planned.
pub fn with_fixed_durations(plan: &TimeTriggeredPlan) -> TimeTriggeredPlan {
    TimeTriggeredPlan {
        steps: plan.steps.iter().map(with_fixed_duration).collect(),
    }
}

fn with_fixed_duration(step: &Step) -> Step {
    let duration = step.duration.clone();
    let mut planned = |leaf: &Expression| match leaf {
        Expression::Duration => duration.clone().map(Expression::Constant),
        _ => None,
    };
    Step {
        // Conditions on durations are converted to bounds.
        action: Arc::new(with_bounds_of_conditions(&step.action).map_leaves(&mut planned)),
        ..step.clone()
    }
}
