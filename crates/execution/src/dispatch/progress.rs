//! Execution progress of a plan: the executed time points and the starts that are ready.

use std::collections::BTreeSet;

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, Constraint, InstanceId, Node, NodeId, StnPlan, network_node};
use elbowroom_stn::Network;

/// Execution progress of a plan.
#[derive(Clone, Debug)]
pub(super) struct PlanProgress {
    /// The time at which each node was executed, on the plan's clock.
    pub(super) executed: Vec<Option<Rational>>,
    /// For each node, the number of its predecessors that have not been executed.
    pub(super) missing: Vec<u32>,
    /// For each node, its successors.
    pub(super) successors: Vec<Vec<NodeId>>,
    /// Starts whose predecessors have all been executed.
    pub(super) ready: BTreeSet<NodeId>,
    /// Instances that were commanded to start and have not ended.
    pub(super) running: BTreeSet<InstanceId>,
    /// Number of instances that have not ended.
    pub(super) remaining: usize,
}

impl PlanProgress {
    /// Creates the progress of a plan without any executed node. `constraints` are the plan's,
    /// without parameters.
    pub(super) fn new(plan: &StnPlan, constraints: &[Constraint]) -> Self {
        let count = plan.nodes.len();
        let mut progress = Self {
            executed: vec![None; count],
            missing: vec![0; count],
            successors: vec![Vec::new(); count],
            ready: BTreeSet::new(),
            running: BTreeSet::new(),
            remaining: plan.instances.len(),
        };
        let mut before = vec![BTreeSet::new(); count];
        let together = simultaneous_groups(count, constraints);
        let mut order = |earlier: NodeId, later: NodeId, least: &Rational| {
            let is_end = is_preceding_end(plan, &together, earlier, later);
            let is_timed = matches!(plan.nodes[earlier.index()], Node::Timed(_));
            // Simultaneous starts do not wait for each other.
            let follows = is_end || together[earlier.index()] != together[later.index()];
            let waits = least.is_positive() || (least.is_zero() && follows);
            if waits && !is_timed && earlier != NodeId::ZERO {
                before[later.index()].insert(earlier);
            }
        };
        for constraint in constraints {
            if plan.duration_of(constraint).is_some() {
                order(constraint.from, constraint.to, &Rational::ONE);
                continue;
            }
            if let Bound::Finite(lower) = &constraint.lower {
                order(constraint.from, constraint.to, lower);
            }
            if let Bound::Finite(upper) = &constraint.upper {
                order(constraint.to, constraint.from, &-upper);
            }
        }
        for (node, what) in plan.nodes() {
            if !matches!(what, Node::Start(_) | Node::Instant(_)) {
                continue;
            }
            for earlier in required_nodes(plan, &before, &together, node) {
                progress.successors[earlier.index()].push(node);
                progress.missing[node.index()] += 1;
            }
        }
        for (node, what) in plan.nodes() {
            if matches!(what, Node::Start(_) | Node::Instant(_))
                && progress.missing[node.index()] == 0
            {
                progress.ready.insert(node);
            }
        }
        progress
    }

    /// Records the execution of a node.
    pub(super) fn record_execution(&mut self, plan: &StnPlan, node: NodeId, time: &Rational) {
        if self.executed[node.index()].replace(time.clone()).is_some() {
            return;
        }
        for after in std::mem::take(&mut self.successors[node.index()]) {
            let missing = &mut self.missing[after.index()];
            *missing -= 1;
            let is_start = matches!(plan.nodes[after.index()], Node::Start(_) | Node::Instant(_));
            if *missing == 0 && is_start && self.executed[after.index()].is_none() {
                self.ready.insert(after);
            }
        }
    }
}

/// Returns `true` if `node` is an end that `later` has to wait for, even if both must happen at the
/// same time. `later` does not wait for the end of an action without duration at the same moment,
/// for example its own end.
fn is_preceding_end(plan: &StnPlan, together: &[usize], node: NodeId, later: NodeId) -> bool {
    match plan.nodes[node.index()] {
        Node::End(id) => together[plan.start(id).index()] != together[later.index()],
        _ => false,
    }
}

/// Returns, for each node, a number that it shares with the nodes that must happen at the same
/// time.
fn simultaneous_groups(count: usize, constraints: &[Constraint]) -> Vec<usize> {
    let mut network = Network::with_nodes(count);
    let node = |id: NodeId| network_node(id);
    let zero = Bound::Finite(Rational::ZERO);
    for constraint in constraints {
        let (from, to) = (node(constraint.from), node(constraint.to));
        if constraint.lower == zero {
            network.add(elbowroom_stn::Constraint::at_least(
                from,
                to,
                Rational::ZERO,
            ));
        }
        if constraint.upper == zero {
            network.add(elbowroom_stn::Constraint::at_most(from, to, Rational::ZERO));
        }
    }
    network.components()
}

/// Returns the nodes that a start waits for: its predecessors, and the ends that precede ends among
/// these.
///
/// Ends at the same time are reported one after the other, and the plan may order only one of them
/// before the start.
fn required_nodes(
    plan: &StnPlan,
    before: &[BTreeSet<NodeId>],
    together: &[usize],
    start: NodeId,
) -> BTreeSet<NodeId> {
    let mut all = before[start.index()].clone();
    let mut frontier: Vec<NodeId> = all.iter().copied().collect();
    while let Some(node) = frontier.pop() {
        if !matches!(plan.nodes[node.index()], Node::End(_)) {
            continue;
        }
        for &earlier in &before[node.index()] {
            if is_preceding_end(plan, together, earlier, start) && all.insert(earlier) {
                frontier.push(earlier);
            }
        }
    }
    all
}
