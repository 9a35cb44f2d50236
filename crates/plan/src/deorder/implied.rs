//! Leaves out constraints that others imply.

use elbowroom_num::{CommonDenominator, Delta, Rational};
use elbowroom_stn::{ConsistentNetwork, Network, Weight};

use crate::network::{Schedule, network_node};
use crate::stn_plan::{Bound, Constraint, Node, NodeId, Reason, StnPlan};

/// The plan without the bounds that its other constraints imply whatever its durations and
/// timed initials are.
///
/// Durations and times of timed initials stay, and count only as not negative here: either may
/// become a parameter later, and then what it alone implied would be lost. A plan of which these times are no
/// schedule is returned as it is.
///
/// What is left is the same for all schedules; how soon it is found is not. In a schedule in which actions take their
/// time, what a constraint of a long plan may follow from is near it. In one in which nothing takes time, all of the plan
/// is, and each constraint would be looked for in all of it.
#[must_use]
pub fn without_implied(mut plan: StnPlan, times: &Schedule) -> StnPlan {
    let Drafted { drafts, bounds } = drafted(&plan);
    // Whole numbers are several times faster. The others are those that envelopes compute with, too, so that the
    // search is compiled for these two alone.
    let implied = if let Some((drafts, times)) = whole(&drafts, times) {
        implied_in(plan.nodes.len(), drafts, times)
    } else {
        let in_delta = |number: &Rational| Some(Delta::from(number.clone()));
        let (drafts, times) = in_terms(&drafts, times, &in_delta).expect("each number is one");
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
    // Most are implied.
    plan.constraints.shrink_to_fit();
    plan
}

/// A constraint of a network, and whether it has to stay.
struct Draft<W> {
    constraint: elbowroom_stn::Constraint<W>,
    stays: bool,
}

/// The network of a plan in which durations and times of timed initials may become anything.
struct Drafted {
    drafts: Vec<Draft<Rational>>,
    /// Of each of the plan's constraints, which drafts its two bounds are.
    bounds: Vec<[Option<usize>; 2]>,
}

fn drafted(plan: &StnPlan) -> Drafted {
    let mut drafts = Vec::with_capacity(plan.nodes.len() + plan.constraints.len());
    let staying = |from, to| Draft {
        constraint: elbowroom_stn::Constraint::at_least(from, to, Rational::ZERO),
        stays: true,
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
                stays: false,
            });
            drafts.len() - 1
        };
        let lower = finite(&constraint.lower)
            .map(|value| add(elbowroom_stn::Constraint::at_least(from, to, value)));
        let upper = finite(&constraint.upper)
            .map(|value| add(elbowroom_stn::Constraint::at_most(from, to, value)));
        bounds.push([lower, upper]);
    }
    Drafted { drafts, bounds }
}

fn finite(bound: &Bound) -> Option<Rational> {
    match bound {
        Bound::Finite(value) => Some(value.clone()),
        Bound::Infinite | Bound::Parameter(_) => None,
    }
}

/// Of each constraint, whether the others imply it; `None` if the times are no schedule.
fn implied_in<W: Weight>(
    node_count: usize,
    drafts: Vec<Draft<W>>,
    times: Vec<W>,
) -> Option<Vec<bool>> {
    let mut network = Network::with_nodes(node_count);
    let mut stays = Vec::with_capacity(drafts.len());
    for draft in drafts {
        network.add(draft.constraint);
        stays.push(draft.stays);
    }
    let network = ConsistentNetwork::by(network, elbowroom_stn::Schedule::new(times))?;
    let mut is_implied = vec![false; stays.len()];
    for id in network.implied(|id| stays[id.index()]) {
        is_implied[id.index()] = true;
    }
    Some(is_implied)
}

/// All bounds and times multiplied by their common denominator, if that leaves them so small that no
/// sum of them overflows.
fn whole(drafts: &[Draft<Rational>], times: &Schedule) -> Option<(Vec<Draft<i128>>, Vec<i128>)> {
    let bounds = drafts.iter().map(|draft| &draft.constraint.bound);
    let unit = CommonDenominator::of(bounds.chain(times.iter()))?;
    in_terms(drafts, times, &|number| unit.whole(number).map(i128::from))
}

/// All bounds and times as other numbers, if they can be that.
fn in_terms<W>(
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
            stays: draft.stays,
        })
    };
    Some((
        drafts.iter().map(draft).collect::<Option<_>>()?,
        times.iter().map(number).collect::<Option<_>>()?,
    ))
}

/// The plan with those of the sides that its other constraints do not imply.
pub(super) fn with_sides(mut plan: StnPlan, mut sides: Vec<Constraint>) -> StnPlan {
    if sides.is_empty() {
        return plan;
    }
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
