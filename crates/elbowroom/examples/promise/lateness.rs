//! Failures that are excused by a late start before its report.
//!
//! An executor assumes that an action has started once it was commanded, because reports may be
//! lost. So there is no promise for steps after that start in the plan that the world triggers by
//! itself in the meantime.

use std::collections::BTreeSet;

use elbowroom::execution::run::{ExecutedStep, Report};
use elbowroom::execution::{Cause, PreparationResult};
use elbowroom::model::Task;
use elbowroom::num::Rational;
use elbowroom::plan::{InstanceId, Node, NodeId, ParameterId, ParametrizedPlan};

/// Returns `true` if a run ended because this action started too late and the executor could not
/// know. It must be the only instance of its action in the plan, and its start must not have been
/// reported. Either there was no time left, or an action failed that was overtaken.
pub(crate) fn excuses(
    task: &Task,
    prepared: &PreparationResult,
    report: &Report,
    late: &str,
) -> bool {
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
            is_overtaken(task, prepared, report, [late, failed])
        }
        _ => false,
    }
}

/// Returns `true` if an end or a timed initial has come before the late start although the plan
/// puts it after that start, and the failed action is the late one or one that ends after it. If
/// the executor itself started an action too early, the late start is not an excuse, unless the
/// plan puts that action after the late start only because of such an end.
fn is_overtaken(
    task: &Task,
    prepared: &PreparationResult,
    report: &Report,
    [late, failed]: [&str; 2],
) -> bool {
    let plan = &prepared.plan;
    let instances = (0..plan.plan.instances.len()).map(InstanceId::from);
    let name = |id: InstanceId| plan.plan.instance(id).action.name.as_str();
    let Some(start) = instances.clone().find(|id| name(*id) == late) else {
        return false;
    };
    let start = plan.plan.start(start);
    let has_ended = |id: InstanceId| {
        let mut executed = report.executed.iter();
        executed.any(|it| it.ending.is_some() && it.step.action.name == name(id))
    };
    let later = later_than(prepared, start);
    let kept = put_behind(plan, start, &|node| match plan.plan.nodes[node.index()] {
        Node::End(id) => !has_ended(id),
        _ => true,
    });
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
        // More starts than those that need not wait for the late start.
        let starts = all().filter(|id| !kept.contains(&plan.plan.start(*id)));
        let starts = starts.count();
        let ends = all().filter(|id| !later.contains(&plan.plan.end(*id)));
        let ends = ends.count();
        if executed().count() > starts {
            return false;
        }
        let ended = executed().filter(|executed| executed.ending.is_some());
        is_overtaken |= ended.count() > ends;
        is_concerned |= own == failed && ends < all().count();
    }
    is_overtaken && is_concerned
}

/// Returns the nodes that an executor relying on the box executes or allows only after `first`.
/// Actions may end at the lower ends of their durations, so conditions of their ends must not wait
/// any longer.
fn later_than(prepared: &PreparationResult, first: NodeId) -> BTreeSet<NodeId> {
    let plan = &prepared.plan;
    let mut values = plan.nominal();
    let lower_ends = (0..plan.parameters.len()).map(ParameterId::from).map(|id| {
        let envelope = prepared.envelope.as_ref()?;
        envelope.interval(id).lower.value().cloned()
    });
    for (index, lower) in lower_ends.enumerate() {
        let value = &mut values[ParameterId::from(index)];
        *value = lower.unwrap_or_else(|| value.clone());
    }
    let mut least: Vec<Option<Rational>> = vec![None; plan.plan.nodes.len()];
    least[first.index()] = Some(Rational::ZERO);
    let mut is_new = true;
    while is_new {
        is_new = false;
        for constraint in &plan.plan.constraints {
            let (from, to) = (constraint.from, constraint.to);
            let bounds = [
                (from, to, constraint.lower.at(&values)),
                (to, from, constraint.upper.at(&values).map(|upper| -upper)),
            ];
            for (one, other, bound) in bounds {
                let (Some(known), Some(bound)) = (&least[one.index()], bound) else {
                    continue;
                };
                let time = known + bound;
                if least[other.index()]
                    .as_ref()
                    .is_none_or(|least| time > *least)
                {
                    least[other.index()] = Some(time);
                    is_new = true;
                }
            }
        }
    }
    let nodes = plan.plan.nodes().map(|(node, _)| node);
    let is_later = |node: &NodeId| {
        *node != first
            && least[node.index()]
                .as_ref()
                .is_some_and(|it| !it.is_negative())
    };
    nodes.filter(is_later).collect()
}

/// Returns the nodes after `first` by the constraints of the plan, transitively over nodes for
/// which `counts` holds.
fn put_behind(
    plan: &ParametrizedPlan,
    first: NodeId,
    counts: &dyn Fn(NodeId) -> bool,
) -> BTreeSet<NodeId> {
    let nominal = plan.nominal();
    let mut behind = BTreeSet::new();
    let mut frontier = vec![first];
    while let Some(node) = frontier.pop() {
        for constraint in &plan.plan.constraints {
            let at_least = |limit: Option<Rational>| limit.is_some_and(|it| it.is_positive());
            let at_most = |limit: Option<Rational>| limit.is_some_and(|it| it.is_negative());
            let next = if constraint.from == node && at_least(constraint.lower.at(&nominal)) {
                constraint.to
            } else if constraint.to == node && at_most(constraint.upper.at(&nominal)) {
                constraint.from
            } else {
                continue;
            };
            if behind.insert(next) && counts(next) {
                frontier.push(next);
            }
        }
    }
    behind
}
