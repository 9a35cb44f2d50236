//! Whether facts and times are all that a plan needs.
//!
//! Then deordering has kept all of it: each happening reads the facts that it read in the plan, in
//! every schedule ([`deorder`](elbowroom_plan::deorder) has the argument), and there is nothing to
//! ask the soundness check, which looks at each condition of the plan in the whole network.
//! `crates/elbowroom/tests/deorder_sound.rs` asks it all the same.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, Condition, DurativeBody, Effect, FluentId};
use elbowroom_plan::{ParameterKind, ParametrizedPlan, Reason};

/// Whether nothing in the plan depends on a number that its schedule, or a parameter, may change.
pub(crate) fn are_enough(task: &Task, plan: &ParametrizedPlan) -> bool {
    let is_time =
        |kind: ParameterKind| matches!(kind, ParameterKind::Duration(_) | ParameterKind::Timed(_));
    let constraints = &plan.plan.constraints;
    let actions = || plan.plan.instances.iter().map(|instance| &instance.action);
    if !plan.parameters.iter().all(|own| is_time(own.kind))
        || constraints.iter().any(|own| own.reason == Reason::Side)
        || compares(task, &plan.goal)
        || !actions().all(|action| is_about_facts(task, action))
    {
        return false;
    }
    let timed = task.timed().iter().flat_map(|timed| &timed.changes);
    let mut changing: BTreeSet<FluentId> = timed.filter_map(changed).collect();
    for action in actions() {
        changing.extend(effects(action).filter_map(|effect| changed(&effect.change)));
    }
    actions().all(|action| has_steady_duration(action, &changing))
}

/// Whether a condition reads any number.
fn compares(task: &Task, condition: &Condition) -> bool {
    let mut compares = false;
    condition.visit_comparisons(&mut |_, _| compares = true);
    task.visit_fluents_of(condition, &mut |_| compares = true);
    compares
}

/// Whether the action's conditions are about facts, and its effects are neither conditional nor
/// continuous.
fn is_about_facts(task: &Task, action: &Action) -> bool {
    let conditions = match &action.body {
        Body::Instantaneous(snap) => vec![&snap.condition],
        Body::Durative(body) if !body.continuous.is_empty() => return false,
        Body::Durative(DurativeBody {
            start,
            over_all,
            end,
            ..
        }) => vec![&start.condition, over_all, &end.condition],
    };
    conditions.iter().all(|it| !compares(task, it))
        && effects(action).all(|effect| effect.guard.is_trivial())
}

fn effects(action: &Action) -> impl Iterator<Item = &Effect> {
    let (start, end): (_, &[Effect]) = match &action.body {
        Body::Instantaneous(snap) => (&snap.effects, &[]),
        Body::Durative(body) => (&body.start.effects, &body.end.effects),
    };
    start.iter().chain(end)
}

fn changed(change: &Change) -> Option<FluentId> {
    match change {
        Change::Update { fluent, .. } => Some(*fluent),
        Change::Add(_) | Change::Delete(_) => None,
    }
}

/// Whether the bounds of the action's duration are the same whenever they are read.
fn has_steady_duration(action: &Action, changing: &BTreeSet<FluentId>) -> bool {
    let mut is_steady = true;
    for constraint in action
        .durative()
        .into_iter()
        .flat_map(|body| &body.duration)
    {
        let bound = &constraint.bound;
        bound.visit_fluents(&mut |fluent| is_steady &= !changing.contains(&fluent));
    }
    is_steady
}
