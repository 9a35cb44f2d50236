//! Fixing as few differences as needed, where conditions on numbers leave no other choice.

use elbowroom_num::Rational;
use elbowroom_stn::ConsistentNetwork;

use crate::network::network_node;
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};

/// Adds constraints that hold in the nominal schedule until the oracle finds nothing wrong.
///
/// The oracle names the time points of some obligation that a schedule of the plan violates. Of
/// these, first the order is fixed, then durations, then other differences, one at a time. In
/// the end, what turned out not to be needed is taken back.
///
/// `None` when the oracle is not content even with the nominal schedule alone.
pub fn pin_until_sound(
    plan: StnPlan,
    nominal: &[Rational],
    oracle: &mut dyn FnMut(&StnPlan) -> Option<Vec<NodeId>>,
) -> Option<StnPlan> {
    let given = plan.constraints.len();
    let mut plan = plan;
    while let Some(nodes) = oracle(&plan) {
        let all: Vec<NodeId> = plan.nodes().map(|(node, _)| node).collect();
        let pin = next_pin(&plan, nominal, &nodes).or_else(|| next_pin(&plan, nominal, &all))?;
        plan.constraints.push(pin);
    }
    for index in (given..plan.constraints.len()).rev() {
        let pin = plan.constraints.remove(index);
        if oracle(&plan).is_some() {
            plan.constraints.insert(index, pin);
        }
    }
    Some(plan)
}

/// The plan with every time point where it is in the nominal schedule: for plans about whose other
/// schedules nothing can be told.
#[must_use]
pub fn pinned_to(mut plan: StnPlan, nominal: &[Rational]) -> StnPlan {
    let pins = plan.nodes().skip(1).map(|(node, _)| Constraint {
        from: NodeId::ZERO,
        to: node,
        lower: Bound::Finite(nominal[node.index()].clone()),
        upper: Bound::Finite(nominal[node.index()].clone()),
        reason: Reason::Pinned,
    });
    let pins: Vec<_> = pins.collect();
    plan.constraints.extend(pins);
    plan
}

/// The gentlest constraint about these nodes that is not implied yet.
fn next_pin(plan: &StnPlan, nominal: &[Rational], nodes: &[NodeId]) -> Option<Constraint> {
    let network = ConsistentNetwork::try_from(plan.network(&[])).ok()?;
    let time = |node: NodeId| &nominal[node.index()];
    let mut nodes = nodes.to_vec();
    nodes.sort_by(|&a, &b| time(a).cmp(time(b)).then(a.cmp(&b)));
    nodes.dedup();
    let least = |from: NodeId, to: NodeId| {
        let back = network.distance(network_node(to), network_node(from));
        back.map(|back| -back)
    };
    let most = |from: NodeId, to: NodeId| network.distance(network_node(from), network_node(to));
    let pairs = || nodes.windows(2).map(|pair| (pair[0], pair[1]));
    let order = pairs().find(|&(from, to)| {
        time(from) < time(to) && least(from, to).is_none_or(|least| least.is_negative())
    });
    if let Some((from, to)) = order {
        return Some(Constraint {
            from,
            to,
            lower: Bound::Finite(Rational::ZERO),
            upper: Bound::Infinite,
            reason: Reason::Pinned,
        });
    }
    let is_loose = |&(from, to): &(NodeId, NodeId)| {
        let exact = time(to) - time(from);
        least(from, to).as_ref() != Some(&exact) || most(from, to).as_ref() != Some(&exact)
    };
    let durations = nodes.iter().filter_map(|&node| duration(plan, node));
    let origin = nodes.first().map(|&first| (NodeId::ZERO, first));
    let mut candidates = durations.chain(pairs()).chain(origin);
    let (from, to) = candidates.find(is_loose)?;
    let exact = time(to) - time(from);
    Some(Constraint {
        from,
        to,
        lower: Bound::Finite(exact.clone()),
        upper: Bound::Finite(exact),
        reason: Reason::Pinned,
    })
}

/// Start and end of the durative action to which the node belongs.
fn duration(plan: &StnPlan, node: NodeId) -> Option<(NodeId, NodeId)> {
    match plan.nodes[node.index()] {
        Node::Start(id) | Node::End(id) => Some((plan.start(id), plan.end(id))),
        _ => None,
    }
}
