//! Fixing as few differences as needed, where conditions on numbers leave no other choice.

use elbowroom_num::Rational;
use elbowroom_stn::ConsistentNetwork;

use crate::network::{Schedule, network_node};
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};
use crate::valuation::Valuation;

/// Adds constraints that hold in the nominal schedule until the oracle finds nothing wrong.
///
/// The oracle names the time points of some obligation that a schedule of the plan violates. Of
/// these, what writes a number first takes its [side](Reason::Side) again of what reads it; then
/// the order is fixed, then what the executor chooses, then other differences, one at a time. In
/// the end, what turned out not to be needed is taken back, orders of what nominally falls
/// together first.
///
/// `None` when the oracle is not content even with the nominal schedule alone.
pub fn pin_until_sound(
    plan: StnPlan,
    nominal: &Schedule,
    oracle: &mut dyn FnMut(&StnPlan) -> Option<Vec<NodeId>>,
) -> Option<StnPlan> {
    let (mut plan, mut sides) = without_sides(plan);
    sides.sort_by_key(|side| &nominal[side.from] - &nominal[side.to]);
    let given = plan.constraints.len();
    while let Some(nodes) = oracle(&plan) {
        let all: Vec<NodeId> = plan.nodes().map(|(node, _)| node).collect();
        let about = |nodes: &[NodeId], side: &Constraint| {
            nodes.contains(&side.from) && nodes.contains(&side.to)
        };
        let taken: Vec<_> = sides.extract_if(.., |side| about(&nodes, side)).collect();
        if !taken.is_empty() {
            plan.constraints.extend(taken);
        } else if let Some(pin) = next_pin(&plan, nominal, &nodes) {
            plan.constraints.push(pin);
        } else if !sides.is_empty() {
            plan.constraints.append(&mut sides);
        } else {
            plan.constraints.push(next_pin(&plan, nominal, &all)?);
        }
    }
    for index in (given..plan.constraints.len()).rev() {
        let pin = plan.constraints.remove(index);
        if oracle(&plan).is_some() {
            plan.constraints.insert(index, pin);
        }
    }
    Some(with_all_sides(plan))
}

/// The plan without its [sides](Reason::Side), and these.
#[must_use]
pub fn without_sides(mut plan: StnPlan) -> (StnPlan, Vec<Constraint>) {
    let constraints = std::mem::take(&mut plan.constraints);
    let (sides, others) = constraints
        .into_iter()
        .partition(|constraint| constraint.reason == Reason::Side);
    plan.constraints = others;
    (plan, sides)
}

/// The plan with its [sides](Reason::Side) for good.
#[must_use]
pub fn with_all_sides(mut plan: StnPlan) -> StnPlan {
    for constraint in &mut plan.constraints {
        if constraint.reason == Reason::Side {
            constraint.reason = Reason::OverAll;
        }
    }
    plan
}

/// The plan with its [sides](Reason::Side) for good, but of two that make time points fall
/// together only the first.
#[must_use]
pub fn with_sides_one_way(plan: StnPlan) -> StnPlan {
    let (mut plan, sides) = without_sides(plan);
    for (index, side) in sides.iter().enumerate() {
        let is_opposite = |other: &Constraint| (other.from, other.to) == (side.to, side.from);
        if !sides[..index].iter().any(is_opposite) {
            plan.constraints.push(side.clone());
        }
    }
    with_all_sides(plan)
}

/// The plan with every time point where it is in the nominal schedule: for plans about whose other
/// schedules nothing can be told.
#[must_use]
pub fn pinned_to(mut plan: StnPlan, nominal: &Schedule) -> StnPlan {
    let pins = plan.nodes().skip(1).map(|(node, _)| Constraint {
        from: NodeId::ZERO,
        to: node,
        lower: Bound::Finite(nominal[node].clone()),
        upper: Bound::Finite(nominal[node].clone()),
        reason: Reason::Pinned,
    });
    let pins: Vec<_> = pins.collect();
    plan.constraints.extend(pins);
    plan
}

/// The gentlest constraint about these nodes that is not implied yet.
fn next_pin(plan: &StnPlan, nominal: &Schedule, nodes: &[NodeId]) -> Option<Constraint> {
    let network = ConsistentNetwork::try_from(plan.network(&Valuation::default())).ok()?;
    let time = |node: NodeId| &nominal[node];
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
    let exactly = |from: NodeId, to: NodeId| Constraint {
        from,
        to,
        lower: Bound::Finite(time(to) - time(from)),
        upper: Bound::Finite(time(to) - time(from)),
        reason: Reason::Pinned,
    };
    let is_loose = |&(from, to): &(NodeId, NodeId)| {
        let exact = time(to) - time(from);
        least(from, to).as_ref() != Some(&exact) || most(from, to).as_ref() != Some(&exact)
    };
    // Where how long an action takes is settled, its start stands for its end: that is what the
    // executor chooses, and it leaves the duration free to become a parameter.
    let mut chosen: Vec<NodeId> = nodes
        .iter()
        .map(|&node| match duration(plan, node) {
            Some((start, end)) if !is_loose(&(start, end)) => start,
            None if matches!(plan.nodes[node.index()], Node::Timed(_)) => NodeId::ZERO,
            _ => node,
        })
        .collect();
    chosen.sort_by(|&a, &b| time(a).cmp(time(b)).then(a.cmp(&b)));
    chosen.dedup();
    let durations = nodes.iter().filter_map(|&node| duration(plan, node));
    let first = chosen.first().copied();
    let from_first = chosen
        .iter()
        .skip(1)
        .map(|&node| (first.unwrap_or(node), node));
    let origin = first.map(|first| (NodeId::ZERO, first));
    let mut candidates = durations.chain(from_first).chain(origin);
    candidates
        .find(is_loose)
        .map(|(from, to)| exactly(from, to))
}

/// Start and end of the durative action to which the node belongs.
fn duration(plan: &StnPlan, node: NodeId) -> Option<(NodeId, NodeId)> {
    match plan.nodes[node.index()] {
        Node::Start(id) | Node::End(id) => Some((plan.start(id), plan.end(id))),
        _ => None,
    }
}
