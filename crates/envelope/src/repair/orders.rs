//! Happenings that keep their order, and happenings that may change it.

use std::cell::OnceCell;
use std::collections::BTreeSet;

use elbowroom_model::ground::{Body, Effect, FactId, FluentId};
use elbowroom_model::{Footprint, Task};
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Node, NodeId, ParametrizedPlan, Schedule, StnPlan};

use crate::obligations::interfering_in_order;

/// Order of a plan's happenings, as far as the plan fixes it.
pub(super) struct Orders {
    /// Interfering actions, the earlier first, that keep their order.
    pub(super) fixed_pairs: Vec<(NodeId, NodeId)>,
    /// The footprints, by node.
    pub(super) footprints: Vec<Footprint>,
    /// For each node, the nodes that always come before it, or with it.
    before: Vec<BTreeSet<NodeId>>,
    /// `true` if effects have conditions, so that the changes of one happening can depend on all
    /// others.
    pub(super) is_conditional: bool,
    /// Pairs of interfering happenings without a fixed order, the smaller number first. Computed
    /// when first needed.
    open_pairs: OnceCell<BTreeSet<(NodeId, NodeId)>>,
}

impl Orders {
    pub(super) fn new(task: &Task, plan: &ParametrizedPlan, order: Option<&Schedule>) -> Self {
        let nodes = || plan.plan.nodes().map(|(node, _)| node);
        let kept = order.map(|times| {
            let in_order = actions_in_order(&plan.plan, times);
            interfering_in_order(task, &plan.plan, &in_order)
        });
        let kept = kept.unwrap_or_default();
        let mut later: Vec<Vec<NodeId>> = vec![Vec::new(); plan.plan.nodes.len()];
        for &(first, second) in &kept {
            later[first.index()].push(second);
        }
        for constraint in &plan.plan.constraints {
            let is_least = |bound: &Bound| match bound {
                Bound::Infinite => false,
                Bound::Finite(value) => !value.is_negative(),
                Bound::Parameter(id) => {
                    let least = plan.parameter(*id).range.lower.value();
                    least.is_some_and(|least| !least.is_negative())
                }
            };
            if is_least(&constraint.lower) {
                later[constraint.from.index()].push(constraint.to);
            }
        }
        let mut fixed: Vec<(&Rational, NodeId)> = nodes()
            .filter_map(|node| Some((fixed_time(plan, node)?, node)))
            .collect();
        fixed.sort_unstable();
        for (at, (time, first)) in fixed.iter().enumerate() {
            let after = fixed[at + 1..].iter().filter(|(other, _)| other > time);
            later[first.index()].extend(after.map(|(_, second)| *second));
        }
        let mut before = vec![BTreeSet::new(); plan.plan.nodes.len()];
        for first in nodes() {
            let mut stack = later[first.index()].clone();
            while let Some(node) = stack.pop() {
                if before[node.index()].insert(first) {
                    stack.extend(&later[node.index()]);
                }
            }
        }
        Self {
            fixed_pairs: kept,
            footprints: nodes()
                .map(|node| plan.plan.footprint(task, node))
                .collect(),
            before,
            is_conditional: plan.plan.instances.iter().any(|instance| {
                let guarded =
                    |effects: &[Effect]| effects.iter().any(|effect| !effect.guard.is_trivial());
                match &instance.action.body {
                    Body::Instantaneous(snap) => guarded(&snap.effects),
                    Body::Durative(body) => {
                        guarded(&body.start.effects)
                            || guarded(&body.end.effects)
                            || body.continuous.iter().any(|own| !own.guard.is_trivial())
                    }
                }
            }),
            open_pairs: OnceCell::new(),
        }
    }

    /// Returns `true` if the order of the two nodes is not fixed.
    fn is_open(&self, one: NodeId, other: NodeId) -> bool {
        one != other
            && !self.before[one.index()].contains(&other)
            && !self.before[other.index()].contains(&one)
    }

    /// Returns two interfering happenings without a fixed order that affects the facts, or any
    /// numbers if `numbers`, that `anchors` read; pairs in `decided` are skipped.
    pub(super) fn undecided(
        &self,
        facts: &BTreeSet<FactId>,
        numbers: bool,
        anchors: &[NodeId],
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Option<(NodeId, NodeId)> {
        let nodes: Vec<NodeId> = (0..self.footprints.len()).map(NodeId::from).collect();
        let is_writer = |node: NodeId| {
            let footprint = &self.footprints[node.index()];
            let mut written = footprint.adds.iter().chain(&footprint.deletes);
            let shifts = !footprint.shifts.is_empty() || !footprint.assigns.is_empty();
            self.is_conditional || written.any(|fact| facts.contains(fact)) || (numbers && shifts)
        };
        let writers: Vec<NodeId> = nodes
            .iter()
            .copied()
            .filter(|&node| is_writer(node))
            .collect();
        // The changes of a writer may depend on numbers that it reads.
        let readers = if self.is_conditional || numbers {
            &nodes[..]
        } else {
            &[]
        };
        // Pairs with the nodes that read the flawed condition come first, because they decide most.
        let of = |own: &[NodeId]| -> Vec<(NodeId, NodeId)> {
            own.iter()
                .flat_map(|&node| pairs_with(node, &writers))
                .collect()
        };
        let pairs = of(anchors)
            .into_iter()
            .chain(of(&writers))
            .chain(of(readers));
        let open = self.open_pairs();
        let mut pairs = pairs.filter(|pair| open.contains(pair));
        pairs.find(|pair| !decided.contains(pair))
    }

    fn open_pairs(&self) -> &BTreeSet<(NodeId, NodeId)> {
        self.open_pairs.get_or_init(|| {
            let nodes = || (0..self.footprints.len()).map(NodeId::from);
            let pairs =
                nodes().flat_map(|one| nodes().take(one.index()).map(move |other| (other, one)));
            let footprint = |node: NodeId| &self.footprints[node.index()];
            pairs
                .filter(|&(one, other)| {
                    self.is_open(one, other) && footprint(one).interferes_with(footprint(other))
                })
                .collect()
        })
    }

    /// Returns the two as a pair, if their order can still be decided.
    pub(super) fn pair(
        &self,
        one: NodeId,
        other: NodeId,
        decided: &BTreeSet<(NodeId, NodeId)>,
    ) -> Option<(NodeId, NodeId)> {
        let pair = (one.min(other), one.max(other));
        (self.is_open(one, other) && !decided.contains(&pair)).then_some(pair)
    }
}

/// Returns the pairs of the node with each other node, the smaller number first.
fn pairs_with(node: NodeId, others: &[NodeId]) -> impl Iterator<Item = (NodeId, NodeId)> + '_ {
    others
        .iter()
        .filter(move |&&other| other != node)
        .map(move |&other| (node.min(other), node.max(other)))
}

/// Returns the time of timed initials that no parameter moves.
fn fixed_time(plan: &ParametrizedPlan, node: NodeId) -> Option<&Rational> {
    if !matches!(plan.plan.nodes[node.index()], Node::Timed(_)) {
        return None;
    }
    plan.plan.constraints.iter().find_map(|constraint| {
        match (&constraint.lower, &constraint.upper) {
            (Bound::Finite(lower), Bound::Finite(upper))
                if constraint.from == NodeId::ZERO && constraint.to == node && lower == upper =>
            {
                Some(lower)
            }
            _ => None,
        }
    })
}

/// Returns the starts and ends of actions in order of time. If they coincide, ends of actions with
/// a positive duration come before starts, and the rest is in the order of the plan.
fn actions_in_order(plan: &StnPlan, times: &Schedule) -> Vec<NodeId> {
    let rank = |node: NodeId| match plan.nodes[node.index()] {
        Node::End(id) if times[plan.start(id)] < times[node] => 0,
        _ => 1,
    };
    let is_action = |what: Node| matches!(what, Node::Start(_) | Node::End(_) | Node::Instant(_));
    let nodes = plan.nodes().filter(|&(_, what)| is_action(what));
    let mut nodes: Vec<NodeId> = nodes.map(|(node, _)| node).collect();
    nodes.sort_by(|&a, &b| {
        let by_time = times[a].cmp(&times[b]);
        by_time.then(rank(a).cmp(&rank(b))).then(a.cmp(&b))
    });
    nodes
}

/// Returns the facts that a condition depends on, and `true` if it depends on numbers.
pub(super) fn read_by(
    task: &Task,
    condition: &elbowroom_model::ground::Condition,
) -> (BTreeSet<FactId>, bool) {
    let mut facts = BTreeSet::new();
    task.visit_facts_of(condition, &mut |fact| {
        facts.insert(fact);
    });
    let mut fluents: BTreeSet<FluentId> = BTreeSet::new();
    task.visit_fluents_of(condition, &mut |fluent| {
        fluents.insert(fluent);
    });
    (facts, !fluents.is_empty())
}
