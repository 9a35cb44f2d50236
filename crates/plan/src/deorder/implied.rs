//! Leaves out constraints that others imply.

use std::collections::BTreeSet;

use elbowroom_num::Rational;
use elbowroom_stn::{ConsistentNetwork, ConstraintId, Network};

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
    let Ok(network) = ConsistentNetwork::try_from(network) else {
        return plan;
    };
    let keep = |id: ConstraintId| kept.contains(&id);
    let implied = match spread_out(&plan) {
        Some(schedule) if schedule.holds_in(network.network()) => {
            network.implied_seen_from(&schedule, keep)
        }
        _ => network.implied(keep),
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

/// The plan's earliest schedule, in which its actions take their time; `None` if it has none.
///
/// From there, what a constraint of a long plan may follow from is near it. In a schedule in which
/// nothing takes time, all of the plan is, and each constraint would be looked for in all of it.
fn spread_out(plan: &StnPlan) -> Option<elbowroom_stn::Schedule> {
    let bounds = |own: &Constraint| [own.lower.parameter(), own.upper.parameter()];
    let mut open = plan.constraints.iter().flat_map(bounds);
    if open.any(|parameter| parameter.is_some()) {
        return None;
    }
    let network = plan.network(&Valuation::default());
    let network = ConsistentNetwork::try_from(network).ok()?;
    Some(network.earliest_schedule(network_node(NodeId::ZERO)))
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
