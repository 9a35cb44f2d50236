//! Check that deordering alone keeps everything that a plan needs: [`keeps_all_that_is_read`].

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{
    Action, Body, Change, Condition, DurativeBody, Effect, Expression, FluentId,
};
use elbowroom_num::Rational;

use crate::network::Schedule;
use crate::parameter::{ParameterKind, ParametrizedPlan};
use crate::stn_plan::{InstanceId, Node, NodeId, Reason};

/// Returns `true` if every schedule of a deordered plan is known to be valid, without checking its
/// conditions one by one; `nominal` is one of its schedules.
///
/// In this case there are no processes or events, and each happening reads the same state in every
/// schedule as in `nominal`: the same happenings wrote the facts and fluents that it reads, and the
/// written values do not depend on times. So numbers may change, but not continuously, not by
/// amounts that depend on durations or on parameters, and not under conditions. An over-all
/// condition reads all states during its action. Their order is fixed if the condition is about one
/// fact, or if at most one change of the fluents that it compares can happen during the action.
///
/// `false` means that the result is unknown; the soundness check decides then.
pub fn keeps_all_that_is_read(task: &Task, plan: &ParametrizedPlan, nominal: &Schedule) -> bool {
    let is_time =
        |kind: ParameterKind| matches!(kind, ParameterKind::Duration(_) | ParameterKind::Timed(_));
    let constraints = &plan.plan.constraints;
    let actions = || plan.plan.instances.iter().map(|own| &*own.action);
    if !task.autonomous().is_empty()
        || !plan.parameters.iter().all(|own| is_time(own.kind))
        || constraints.iter().any(|own| own.reason == Reason::Side)
        || !is_plain(task, &plan.goal)
        || !actions().all(|action| has_plain_conditions(task, action))
        || !actions().flat_map(effects).all(is_fixed)
    {
        return false;
    }
    let changes = Changes::of(task, plan, nominal);
    let mut ends = vec![(NodeId::ZERO, NodeId::ZERO); plan.plan.instances.len()];
    for (node, what) in plan.plan.nodes() {
        match what {
            Node::Start(id) => ends[id.index()].0 = node,
            Node::End(id) => ends[id.index()].1 = node,
            _ => {}
        }
    }
    actions().enumerate().all(|(index, action)| {
        let Some(body) = action.durative() else {
            return true;
        };
        let ends = ends[InstanceId::from(index).index()];
        // The over-all condition of an action with duration 0 may be false. It is violated as soon
        // as the action takes time.
        let is_vacuous = nominal[ends.0] == nominal[ends.1] && !body.over_all.is_trivial();
        let mut conjuncts = body.over_all.conjuncts().into_iter();
        !is_vacuous
            && changes.preserves_durations(body)
            && conjuncts.all(|it| changes.preserves_condition(task, it, ends))
    })
}

/// Returns `true` if the condition reads only facts, and fluents that it compares itself.
fn is_plain(task: &Task, condition: &Condition) -> bool {
    let (mut own, mut all, mut is_plain) = (0_usize, 0_usize, true);
    condition.visit_fluents(&mut |_| own += 1);
    task.visit_fluents_of(condition, &mut |_| all += 1);
    condition.visit_comparisons(&mut |left, right| is_plain &= is_steady(left) && is_steady(right));
    is_plain && own == all
}

/// Returns `true` if the value of the expression depends only on the state, not on times.
fn is_steady(expression: &Expression) -> bool {
    let mut is_steady = true;
    expression.visit_leaves(&mut |leaf| {
        is_steady &= matches!(leaf, Expression::Constant(_) | Expression::Fluent(_));
    });
    is_steady
}

fn has_plain_conditions(task: &Task, action: &Action) -> bool {
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
    conditions.iter().all(|condition| is_plain(task, condition))
}

fn effects(action: &Action) -> impl Iterator<Item = &Effect> {
    let (start, end): (_, &[Effect]) = match &action.body {
        Body::Instantaneous(snap) => (&snap.effects, &[]),
        Body::Durative(body) => (&body.start.effects, &body.end.effects),
    };
    start.iter().chain(end)
}

/// Returns `true` if the effect is unconditional and depends only on the state.
fn is_fixed(effect: &Effect) -> bool {
    let is_steady = match &effect.change {
        Change::Add(_) | Change::Delete(_) => true,
        Change::Update { value, .. } => is_steady(value),
    };
    is_steady && effect.guard.is_trivial()
}

/// Returns the instance whose start or end the node is.
fn ends_of(node: Node) -> Option<InstanceId> {
    match node {
        Node::Start(id) | Node::End(id) | Node::Instant(id) => Some(id),
        Node::Zero | Node::Timed(_) => None,
    }
}

/// Times of changes of fluents.
struct Changes<'a> {
    nominal: &'a Schedule,
    /// Happenings that change each fluent, by time.
    nodes: BTreeMap<FluentId, Vec<NodeId>>,
}

impl<'a> Changes<'a> {
    fn of(task: &Task, plan: &ParametrizedPlan, nominal: &'a Schedule) -> Self {
        let mut nodes: BTreeMap<FluentId, Vec<NodeId>> = BTreeMap::new();
        let mut note = |node: NodeId, change: &Change| {
            if let Change::Update { fluent, .. } = change {
                nodes.entry(*fluent).or_default().push(node);
            }
        };
        let body = |id: InstanceId| &plan.plan.instances[id.index()].action.body;
        for (node, what) in plan.plan.nodes() {
            let effects = match (what, ends_of(what).map(body)) {
                (Node::Timed(index), _) => {
                    for change in &task.timed()[index].changes {
                        note(node, change);
                    }
                    continue;
                }
                (Node::End(_), Some(Body::Durative(body))) => &body.end.effects,
                (_, Some(Body::Durative(body))) => &body.start.effects,
                (_, Some(Body::Instantaneous(snap))) => &snap.effects,
                (_, None) => continue,
            };
            for effect in effects {
                note(node, &effect.change);
            }
        }
        for nodes in nodes.values_mut() {
            nodes.sort_by(|a, b| nominal[*a].cmp(&nominal[*b]));
        }
        Self { nominal, nodes }
    }

    /// Returns `true` if the bounds of the action's duration never change.
    fn preserves_durations(&self, body: &DurativeBody) -> bool {
        let mut is_kept = true;
        for constraint in &body.duration {
            let bound = &constraint.bound;
            bound.visit_fluents(&mut |fluent| is_kept &= !self.nodes.contains_key(&fluent));
        }
        is_kept
    }

    /// Returns `true` if a condition that must hold between those two nodes does so in every
    /// schedule.
    fn preserves_condition(
        &self,
        task: &Task,
        conjunct: &Condition,
        (start, end): (NodeId, NodeId),
    ) -> bool {
        let literal = match conjunct {
            Condition::Not(part) => part,
            other => other,
        };
        match literal {
            Condition::Fact(fact) => !task.is_derived(*fact),
            Condition::Compare(..) => {
                let mut read = BTreeSet::new();
                literal.visit_fluents(&mut |fluent| {
                    read.insert(fluent);
                });
                // A change that is simultaneous with the start or the end may be inside the action
                // in another schedule.
                let mut inside: BTreeSet<NodeId> = BTreeSet::new();
                for nodes in read.iter().filter_map(|fluent| self.nodes.get(fluent)) {
                    let others = self.nodes_between(nodes, start, end).iter().copied();
                    let others = others.filter(|node| ![start, end].contains(node));
                    inside.extend(others.take(2));
                }
                inside.len() <= 1
            }
            // Several facts may change in different orders.
            _ => false,
        }
    }

    fn nodes_between<'n>(&self, nodes: &'n [NodeId], start: NodeId, end: NodeId) -> &'n [NodeId] {
        let time = |node: NodeId| -> &Rational { &self.nominal[node] };
        let from = nodes.partition_point(|node| time(*node) < time(start));
        let until = nodes.partition_point(|node| time(*node) <= time(end));
        nodes.get(from..until).unwrap_or_default()
    }
}
