//! Fixes a small number of time differences, as needed for conditions on numbers.

use elbowroom_num::Rational;
use elbowroom_stn::ConsistentNetwork;

use crate::network::{Schedule, network_node};
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};
use crate::valuation::Valuation;

/// Adds constraints that hold in the nominal schedule until the oracle finds no violation.
///
/// The oracle returns the time points of an obligation that some schedule of the plan violates.
/// First, the dropped [sides](Reason::Side) between these points are added again. Then the order of
/// the points is fixed, then durations, then other differences, one at a time. At the end,
/// constraints that are not needed are removed, in reverse order of their addition.
///
/// Returns `None` if the oracle rejects even the nominal schedule.
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
    Some(with_permanent_sides(plan))
}

/// Returns the plan without its [sides](Reason::Side), and the sides.
#[must_use]
pub fn without_sides(mut plan: StnPlan) -> (StnPlan, Vec<Constraint>) {
    let constraints = std::mem::take(&mut plan.constraints);
    let (sides, others) = constraints
        .into_iter()
        .partition(|constraint| constraint.reason == Reason::Side);
    plan.constraints = others;
    (plan, sides)
}

/// Makes the [sides](Reason::Side) of the plan permanent.
#[must_use]
pub fn with_permanent_sides(mut plan: StnPlan) -> StnPlan {
    for constraint in &mut plan.constraints {
        if constraint.reason == Reason::Side {
            constraint.reason = Reason::OverAll;
        }
    }
    plan
}

/// Makes the [sides](Reason::Side) of the plan permanent. Of two sides that would make time points
/// simultaneous, only the first is kept.
#[must_use]
pub fn with_compatible_sides(plan: StnPlan) -> StnPlan {
    let (mut plan, sides) = without_sides(plan);
    for (index, side) in sides.iter().enumerate() {
        let is_opposite = |other: &Constraint| (other.from, other.to) == (side.to, side.from);
        if !sides[..index].iter().any(is_opposite) {
            plan.constraints.push(side.clone());
        }
    }
    with_permanent_sides(plan)
}

/// Returns the plan with every time point fixed at its nominal time, for plans whose other
/// schedules cannot be analysed.
#[must_use]
pub fn with_fixed_times(mut plan: StnPlan, nominal: &Schedule) -> StnPlan {
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

/// Returns the weakest constraint between these nodes that is not implied yet.
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
    // If the duration of an action is fixed, its start represents its end: the executor chooses the
    // start, and the duration can still become a parameter.
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

/// Returns the start and the end of the durative action of the node.
fn duration(plan: &StnPlan, node: NodeId) -> Option<(NodeId, NodeId)> {
    match plan.nodes[node.index()] {
        Node::Start(id) | Node::End(id) => Some((plan.start(id), plan.end(id))),
        _ => None,
    }
}
