//! Leaves out constraints that others imply.

use std::collections::BTreeSet;

use elbowroom_num::{CommonDenominator, Rational};
use elbowroom_stn::{ConsistentNetwork, ConstraintId, Network, Weight};

use crate::network::network_node;
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};
use crate::valuation::Valuation;

/// The plan without the bounds that its other constraints imply whatever its durations and
/// timed initials are.
///
/// Durations and times of timed initials stay, and count only as not negative here: either may
/// become a parameter later, and then what it alone implied would be lost. A plan that has
/// parameters, or no schedule, is returned as it is.
#[must_use]
pub fn without_implied(mut plan: StnPlan) -> StnPlan {
    let mut network = Network::with_nodes(plan.nodes.len());
    let mut kept = BTreeSet::new();
    let mut keep_later = |network: &mut Network, from, to| {
        let least = elbowroom_stn::Constraint::at_least(from, to, Rational::ZERO);
        kept.insert(network.add(least));
    };
    for (node, _) in plan.nodes().skip(1) {
        keep_later(&mut network, network_node(NodeId::ZERO), network_node(node));
    }
    let mut bounds: Vec<[Option<ConstraintId>; 2]> = Vec::with_capacity(plan.constraints.len());
    for constraint in &plan.constraints {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        if is_set(&plan, constraint) {
            keep_later(&mut network, from, to);
            bounds.push([None, None]);
            continue;
        }
        let mut add = |bound: &Bound, is_lower: bool| match bound {
            Bound::Finite(value) if is_lower => {
                Some(network.add(elbowroom_stn::Constraint::at_least(from, to, value.clone())))
            }
            Bound::Finite(value) => {
                Some(network.add(elbowroom_stn::Constraint::at_most(from, to, value.clone())))
            }
            Bound::Infinite | Bound::Parameter(_) => None,
        };
        bounds.push([add(&constraint.lower, true), add(&constraint.upper, false)]);
    }
    let spread = spread_out(&plan);
    let keep = |id: ConstraintId| kept.contains(&id);
    // Whole numbers are several times faster.
    let implied = match whole(&network, spread.as_ref()) {
        Some((network, spread)) => implied_in(network, spread, keep),
        None => implied_in(network, spread, keep),
    };
    let Some(implied) = implied else {
        return plan;
    };
    let implied: BTreeSet<ConstraintId> = implied.into_iter().collect();
    for (constraint, [lower, upper]) in plan.constraints.iter_mut().zip(bounds) {
        if lower.is_some_and(|id| implied.contains(&id)) {
            constraint.lower = Bound::Infinite;
        }
        if upper.is_some_and(|id| implied.contains(&id)) {
            constraint.upper = Bound::Infinite;
        }
    }
    plan.constraints.retain(|constraint| {
        (&constraint.lower, &constraint.upper) != (&Bound::Infinite, &Bound::Infinite)
            || matches!(constraint.reason, Reason::Duration(_))
    });
    plan
}

/// The plan's own network, in whose earliest schedule its actions take their time.
fn spread_out(plan: &StnPlan) -> Option<Network> {
    let bounds = |own: &Constraint| [own.lower.parameter(), own.upper.parameter()];
    let mut open = plan.constraints.iter().flat_map(bounds);
    if open.any(|parameter| parameter.is_some()) {
        return None;
    }
    Some(plan.network(&Valuation::default()))
}

/// What is implied in a network; `None` if it has no schedule.
///
/// It is looked for in the earliest schedule of `spread`, if it has one: there, what a constraint of a long plan
/// may follow from is near it. In a schedule in which nothing takes time, all of the plan is, and each
/// constraint would be looked for in all of it.
fn implied_in<W: Weight>(
    network: Network<W>,
    spread: Option<Network<W>>,
    keep: impl Fn(ConstraintId) -> bool,
) -> Option<Vec<ConstraintId>> {
    let network = ConsistentNetwork::try_from(network).ok()?;
    let spread = spread.and_then(|spread| ConsistentNetwork::try_from(spread).ok());
    let schedule = spread.map(|spread| spread.earliest_schedule(network_node(NodeId::ZERO)));
    Some(match schedule {
        Some(schedule) if schedule.holds_in(network.network()) => {
            network.implied_seen_from(&schedule, keep)
        }
        _ => network.implied(keep),
    })
}

/// The networks with all bounds multiplied by their common denominator, if that leaves them so small that no
/// sum of them overflows.
fn whole(
    network: &Network,
    spread: Option<&Network>,
) -> Option<(Network<i128>, Option<Network<i128>>)> {
    let both = || std::iter::once(network).chain(spread);
    let bounds = both().flat_map(Network::constraints);
    let unit = CommonDenominator::of(bounds.map(|constraint| &constraint.bound))?;
    let whole = |network: &Network| {
        let mut whole = Network::with_nodes(network.node_count());
        for constraint in network.constraints() {
            whole.add(elbowroom_stn::Constraint {
                from: constraint.from,
                to: constraint.to,
                bound: i128::from(unit.whole(&constraint.bound)?),
            });
        }
        Some(whole)
    };
    let spread = match spread {
        Some(spread) => Some(whole(spread)?),
        None => None,
    };
    Some((whole(network)?, spread))
}

/// The plan with those of the sides that its other constraints do not imply.
pub(super) fn with_sides(mut plan: StnPlan, mut sides: Vec<Constraint>) -> StnPlan {
    // As above, but sides are least distances and may be given up: none makes another needless.
    let mut network = Network::with_nodes(plan.nodes.len());
    for constraint in &plan.constraints {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        let lower = match &constraint.lower {
            _ if is_set(&plan, constraint) => Rational::ZERO,
            Bound::Finite(lower) => lower.clone(),
            Bound::Infinite | Bound::Parameter(_) => continue,
        };
        network.add(elbowroom_stn::Constraint::at_least(from, to, lower));
    }
    if let Ok(network) = ConsistentNetwork::try_from(network) {
        sides.retain(|side| {
            let back = network.distance(network_node(side.to), network_node(side.from));
            match (&side.lower, back) {
                (Bound::Finite(lower), Some(back)) => -back < *lower,
                _ => true,
            }
        });
    }
    plan.constraints.extend(sides);
    plan
}

/// Whether the constraint says how long an action takes or when a timed initial happens.
fn is_set(plan: &StnPlan, constraint: &Constraint) -> bool {
    match constraint.reason {
        Reason::Duration(_) | Reason::Timed(_) => true,
        Reason::Pinned => {
            let node = |id: NodeId| plan.nodes[id.index()];
            matches!(
                (node(constraint.from), node(constraint.to)),
                (Node::Start(from), Node::End(to)) if from == to
            )
        }
        _ => false,
    }
}
