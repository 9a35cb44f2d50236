//! Removal of constraints that others imply.

use elbowroom_num::{CommonDenominator, Delta, Rational};
use elbowroom_stn::{ConsistentNetwork, Network, Weight};

use crate::network::{Schedule, network_node};
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};

/// Returns the plan without the bounds that its other constraints imply for all durations and times
/// of timed initials.
///
/// Durations and times of timed initials are kept, and count only as not negative: either may
/// become a parameter later, so nothing may depend on their values. If `times` is not a schedule of
/// the plan, the plan is returned unchanged.
///
/// The result does not depend on the schedule, but the running time does. If actions take time in
/// the schedule, the constraints that imply a given one are close to it, even in a long plan. If
/// nothing takes time, each constraint has to be compared with the whole plan.
#[must_use]
pub fn without_implied(mut plan: StnPlan, times: &Schedule) -> StnPlan {
    let DraftNetwork { drafts, bounds } = build_network(&plan);
    // Integers are several times faster. The other case uses the number type of envelopes, so that
    // the search is compiled for these two types only.
    let implied = if let Some((drafts, times)) = scale_to_integers(&drafts, times) {
        implied_in(plan.nodes.len(), drafts, times)
    } else {
        let in_delta = |number: &Rational| Some(Delta::from(number.clone()));
        let (drafts, times) =
            convert_numbers(&drafts, times, &in_delta).expect("each number is one");
        implied_in(plan.nodes.len(), drafts, times)
    };
    let Some(is_implied) = implied else {
        return plan;
    };
    for (constraint, [lower, upper]) in plan.constraints.iter_mut().zip(bounds) {
        if lower.is_some_and(|id| is_implied[id]) {
            constraint.lower = Bound::Infinite;
        }
        if upper.is_some_and(|id| is_implied[id]) {
            constraint.upper = Bound::Infinite;
        }
    }
    plan.constraints.retain(|constraint| {
        (&constraint.lower, &constraint.upper) != (&Bound::Infinite, &Bound::Infinite)
            || matches!(constraint.reason, Reason::Duration(_))
    });
    // Most constraints are implied.
    plan.constraints.shrink_to_fit();
    plan
}

/// A constraint of a network; `true` if it has to be kept.
struct Draft<W> {
    constraint: elbowroom_stn::Constraint<W>,
    is_kept: bool,
}

/// Network of a plan with arbitrary durations and times of timed initials.
struct DraftNetwork {
    drafts: Vec<Draft<Rational>>,
    /// For each of the plan's constraints, the positions of its two bounds among the drafts.
    bounds: Vec<[Option<usize>; 2]>,
}

fn build_network(plan: &StnPlan) -> DraftNetwork {
    let mut drafts = Vec::with_capacity(plan.nodes.len() + plan.constraints.len());
    let staying = |from, to| Draft {
        constraint: elbowroom_stn::Constraint::at_least(from, to, Rational::ZERO),
        is_kept: true,
    };
    let zero = network_node(NodeId::ZERO);
    for (node, _) in plan.nodes().skip(1) {
        drafts.push(staying(zero, network_node(node)));
    }
    let mut bounds = Vec::with_capacity(plan.constraints.len());
    for constraint in &plan.constraints {
        let (from, to) = (network_node(constraint.from), network_node(constraint.to));
        if is_set(plan, constraint) {
            drafts.push(staying(from, to));
            bounds.push([None, None]);
            continue;
        }
        let mut add = |constraint| {
            drafts.push(Draft {
                constraint,
                is_kept: false,
            });
            drafts.len() - 1
        };
        let lower = finite(&constraint.lower)
            .map(|value| add(elbowroom_stn::Constraint::at_least(from, to, value)));
        let upper = finite(&constraint.upper)
            .map(|value| add(elbowroom_stn::Constraint::at_most(from, to, value)));
        bounds.push([lower, upper]);
    }
    DraftNetwork { drafts, bounds }
}

fn finite(bound: &Bound) -> Option<Rational> {
    match bound {
        Bound::Finite(value) => Some(value.clone()),
        Bound::Infinite | Bound::Parameter(_) => None,
    }
}

/// Returns, for each constraint, `true` if the others imply it. Returns `None` if the times are not
/// a schedule.
fn implied_in<W: Weight>(
    node_count: usize,
    drafts: Vec<Draft<W>>,
    times: Vec<W>,
) -> Option<Vec<bool>> {
    let mut network = Network::with_nodes(node_count);
    let mut stays = Vec::with_capacity(drafts.len());
    for draft in drafts {
        network.add(draft.constraint);
        stays.push(draft.is_kept);
    }
    let network = ConsistentNetwork::with_schedule(network, elbowroom_stn::Schedule::new(times))?;
    let mut is_implied = vec![false; stays.len()];
    for id in network.implied(|id| stays[id.index()]) {
        is_implied[id.index()] = true;
    }
    Some(is_implied)
}

/// Multiplies all bounds and times by their common denominator. Returns `None` if a sum of the
/// results might overflow.
fn scale_to_integers(
    drafts: &[Draft<Rational>],
    times: &Schedule,
) -> Option<(Vec<Draft<i128>>, Vec<i128>)> {
    let bounds = drafts.iter().map(|draft| &draft.constraint.bound);
    let unit = CommonDenominator::of(bounds.chain(times.iter()))?;
    convert_numbers(drafts, times, &|number| {
        unit.to_integer(number).map(i128::from)
    })
}

/// Converts all bounds and times to another number type, if it can represent them.
fn convert_numbers<W>(
    drafts: &[Draft<Rational>],
    times: &Schedule,
    number: &dyn Fn(&Rational) -> Option<W>,
) -> Option<(Vec<Draft<W>>, Vec<W>)> {
    let draft = |draft: &Draft<Rational>| {
        let constraint = &draft.constraint;
        Some(Draft {
            constraint: elbowroom_stn::Constraint {
                from: constraint.from,
                to: constraint.to,
                bound: number(&constraint.bound)?,
            },
            is_kept: draft.is_kept,
        })
    };
    Some((
        drafts.iter().map(draft).collect::<Option<_>>()?,
        times.iter().map(number).collect::<Option<_>>()?,
    ))
}

/// Returns the plan with the sides that its other constraints do not imply.
pub(super) fn with_sides(mut plan: StnPlan, mut sides: Vec<Constraint>) -> StnPlan {
    if sides.is_empty() {
        return plan;
    }
    // As above, except that sides are least distances and may be dropped later: no side makes
    // another one redundant.
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

/// Returns `true` if the constraint sets the duration of an action or the time of a timed initial.
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
