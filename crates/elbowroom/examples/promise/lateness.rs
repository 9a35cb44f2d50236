//! What a late start excuses, before anybody has heard of it.
//!
//! Whoever was told to start in time is taken to have started: reports may be lost. So nothing is promised of
//! what the plan has after that start, where the world brings it about by itself meanwhile.

use std::collections::BTreeSet;

use elbowroom::execution::run::{ExecutedStep, Report};
use elbowroom::execution::{Cause, Prepared};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::plan::{InstanceId, Node, NodeId, ParametrizedPlan};

/// Whether a run ended because this action, of which the plan has no other, started too late, without the
/// executor being able to know: it had not heard of the start, and either had no time left, or something failed
/// that was overtaken.
pub(crate) fn excuses(task: &Task, prepared: &Prepared, report: &Report, late: &str) -> bool {
    let Some(reason) = report.reasons.first() else {
        return false;
    };
    let is_known = |executed: &ExecutedStep| {
        executed.step.action.name == late && executed.step.start < report.time
    };
    if report.executed.iter().any(is_known) {
        return false;
    }
    match reason.cause {
        Cause::Unreachable => true,
        Cause::Failed => {
            let failed = reason.action.as_deref().unwrap_or_default();
            is_overtaken(task, &prepared.plan, report, [late, failed])
        }
        _ => false,
    }
}

/// Whether an end or a timed initial has come before a start that the plan puts before it, and what failed
/// is the action that starts there or one that ends after it. Who starts something that has to come later is
/// to blame, and not the late start.
fn is_overtaken(
    task: &Task,
    plan: &ParametrizedPlan,
    report: &Report,
    [late, failed]: [&str; 2],
) -> bool {
    let instances = (0..plan.plan.instances.len()).map(InstanceId::from);
    let name = |id: InstanceId| plan.plan.instance(id).action.name.as_str();
    let Some(start) = instances.clone().find(|id| name(*id) == late) else {
        return false;
    };
    let later = later_than(plan, plan.plan.start(start));
    let names: BTreeSet<&str> = instances.clone().map(name).collect();
    let mut is_overtaken = plan.plan.nodes().any(|(node, what)| {
        matches!(what, Node::Timed(timed) if task.timed()[timed].time <= report.time)
            && later.contains(&node)
    });
    let mut is_concerned = failed == late;
    for own in names.into_iter().filter(|own| *own != late) {
        let all = || instances.clone().filter(|id| name(*id) == own);
        let executed = || {
            let executed = report.executed.iter();
            executed.filter(|executed| executed.step.action.name == own)
        };
        // More than those that need not wait for the late start.
        let not_later = |node: fn(&ParametrizedPlan, InstanceId) -> NodeId| {
            all().filter(|id| !later.contains(&node(plan, *id))).count()
        };
        let starts = not_later(|plan, id| plan.plan.start(id));
        let ends = not_later(|plan, id| plan.plan.end(id));
        if executed().count() > starts {
            return false;
        }
        let ended = executed().filter(|executed| executed.ending.is_some());
        is_overtaken |= ended.count() > ends;
        is_concerned |= own == failed && ends < all().count();
    }
    is_overtaken && is_concerned
}

/// What the plan does not allow before a node.
fn later_than(plan: &ParametrizedPlan, first: NodeId) -> BTreeSet<NodeId> {
    let nominal = plan.nominal();
    let mut later = BTreeSet::new();
    let mut frontier = vec![first];
    while let Some(node) = frontier.pop() {
        for constraint in &plan.plan.constraints {
            let at_least = |limit: Option<Rational>| limit.is_some_and(|it| !it.is_negative());
            let at_most = |limit: Option<Rational>| limit.is_some_and(|it| !it.is_positive());
            let next = if constraint.from == node && at_least(constraint.lower.at(&nominal)) {
                constraint.to
            } else if constraint.to == node && at_most(constraint.upper.at(&nominal)) {
                constraint.from
            } else {
                continue;
            };
            if later.insert(next) {
                frontier.push(next);
            }
        }
    }
    later
}
