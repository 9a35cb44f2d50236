//! Actions that can be repeated after a failure.

use std::fmt;

use elbowroom_model::ground::{Body, Change};
use elbowroom_model::{Footprint, Task};
use elbowroom_plan::{Bound, InstanceId, Node, NodeId, ParameterKind, ParametrizedPlan};

/// Reason why an action has no retries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NotRetriable {
    /// It takes no time.
    Instantaneous,
    /// It began before the plan.
    Running,
    /// It changes numbers at its start or while it runs, which a failure does not revert.
    Numbers,
    /// An effect of its start depends on a condition, and a failure does not revert it.
    Conditional,
    /// Another action, not ordered with its start, uses a fact that its start changes.
    SharedFact,
    /// The executor chooses its duration from an interval.
    ChosenDuration,
}

impl fmt::Display for NotRetriable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Instantaneous => "it takes no time",
            Self::Running => "it began before the plan",
            Self::Numbers => {
                "it changes numbers at its start or while it runs, which a failure does not revert"
            }
            Self::Conditional => "an effect of its start depends on a condition",
            Self::SharedFact => {
                "another action may use or change a fact that its start changes at the same time"
            }
            Self::ChosenDuration => "the executor chooses its duration",
        })
    }
}

/// Decides for each action instance of a plan whether it can be repeated after a failure that
/// reverts the effects of its start.
pub fn retriable(task: &Task, plan: &ParametrizedPlan) -> Vec<Result<(), NotRetriable>> {
    let order = Order::new(plan);
    let footprints: Vec<Footprint> = plan
        .plan
        .nodes()
        .map(|(node, _)| plan.plan.footprint(task, node))
        .collect();
    let ids = (0..plan.plan.instances.len()).map(InstanceId::from);
    ids.map(|id| obstacle(task, plan, &order, &footprints, id).map_or(Ok(()), Err))
        .collect()
}

fn obstacle(
    task: &Task,
    plan: &ParametrizedPlan,
    order: &Order,
    footprints: &[Footprint],
    id: InstanceId,
) -> Option<NotRetriable> {
    let Body::Durative(body) = &plan.plan.instance(id).action.body else {
        return Some(NotRetriable::Instantaneous);
    };
    if body.is_running {
        return Some(NotRetriable::Running);
    }
    let mut facts = Vec::new();
    for effect in &body.start.effects {
        match &effect.change {
            Change::Add(fact) | Change::Delete(fact) => facts.push(*fact),
            Change::Update { .. } => return Some(NotRetriable::Numbers),
        }
        if !effect.guard.is_trivial() {
            return Some(NotRetriable::Conditional);
        }
    }
    if !body.continuous.is_empty() {
        return Some(NotRetriable::Numbers);
    }
    let start = plan.plan.start(id);
    let before = order.reaching(start);
    let after = order.reachable(start);
    let mentions = |footprint: &Footprint| {
        facts.iter().any(|fact| {
            footprint.reads.contains(fact)
                || footprint.adds.contains(fact)
                || footprint.deletes.contains(fact)
        })
    };
    for (node, kind) in plan.plan.nodes() {
        let is_own = matches!(kind, Node::Start(own) | Node::End(own) if own == id);
        let is_ordered = before[node.index()] || after[node.index()];
        if !is_own && !is_ordered && mentions(&footprints[node.index()]) {
            return Some(NotRetriable::SharedFact);
        }
    }
    for other in (0..plan.plan.instances.len()).map(InstanceId::from) {
        if other == id {
            continue;
        }
        if let Body::Durative(theirs) = &plan.plan.instance(other).action.body {
            let mut reads = Footprint::of_condition(task, &theirs.over_all);
            for effect in theirs.end.effects.iter().chain(&theirs.start.effects) {
                reads.include(Footprint::of_condition(task, &effect.guard.over_all));
            }
            for effect in &theirs.continuous {
                reads.include(Footprint::of_condition(task, &effect.guard.over_all));
                reads.include(Footprint::of_condition(task, &effect.guard.now));
            }
            let (starts, ends) = (plan.plan.start(other), plan.plan.end(other));
            let is_ordered = before[ends.index()] || after[starts.index()];
            if !is_ordered && mentions(&reads) {
                return Some(NotRetriable::SharedFact);
            }
        }
    }
    None
}

/// Order of the nodes in all schedules, as far as bounds that are not negative imply it.
struct Order {
    next: Vec<Vec<usize>>,
    previous: Vec<Vec<usize>>,
}

impl Order {
    fn new(plan: &ParametrizedPlan) -> Self {
        let count = plan.plan.nodes.len();
        let mut order = Self {
            next: vec![Vec::new(); count],
            previous: vec![Vec::new(); count],
        };
        let mut fixed = vec![(elbowroom_num::Rational::ZERO, NodeId::ZERO.index())];
        for constraint in &plan.plan.constraints {
            let (from, to) = (constraint.from.index(), constraint.to.index());
            let is_forward = match &constraint.lower {
                Bound::Finite(lower) => !lower.is_negative(),
                Bound::Parameter(id) => matches!(
                    plan.parameter(*id).kind,
                    ParameterKind::Duration(_) | ParameterKind::Timed(_)
                ),
                Bound::Infinite => false,
            };
            if is_forward {
                order.add(from, to);
            }
            if let Bound::Finite(upper) = &constraint.upper {
                if !upper.is_positive() {
                    order.add(to, from);
                }
                if constraint.from == NodeId::ZERO && constraint.lower == constraint.upper {
                    fixed.push((upper.clone(), to));
                }
            }
        }
        fixed.sort();
        for pair in fixed.windows(2) {
            order.add(pair[0].1, pair[1].1);
        }
        order
    }

    fn add(&mut self, earlier: usize, later: usize) {
        self.next[earlier].push(later);
        self.previous[later].push(earlier);
    }

    fn reachable(&self, node: NodeId) -> Vec<bool> {
        closure(&self.next, node.index())
    }

    fn reaching(&self, node: NodeId) -> Vec<bool> {
        closure(&self.previous, node.index())
    }
}

fn closure(next: &[Vec<usize>], start: usize) -> Vec<bool> {
    let mut seen = vec![false; next.len()];
    let mut stack = vec![start];
    seen[start] = true;
    while let Some(node) = stack.pop() {
        for &other in &next[node] {
            if !seen[other] {
                seen[other] = true;
                stack.push(other);
            }
        }
    }
    seen
}
