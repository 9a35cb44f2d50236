//! Weak controllability: a schedule for every choice of durations.
//!
//! For each choice of durations of the contingent links there are times for the other points (Vidal
//! & Fargier 1999). They may depend on durations that are not known yet. The durations with a
//! schedule form a convex set, so it is enough to check the corners, where each link has its least
//! or its greatest duration. The relevant corners are found by [`branching`].
//!
//! A link without an upper bound needs no branching: if any constraint limits its end from above,
//! some duration is too long.
//!
//! [`branching`]: elbowroom_stn::branching

use std::collections::BTreeMap;

use elbowroom_num::{Rational, Side};
use elbowroom_stn::corner_search::{Branching, Corner, OpenBound, TooManyBranches};
use elbowroom_stn::uncertain::{ContingentLink, LinkId, UncertainNetwork};
use elbowroom_stn::{Constraint, ConstraintId, Network, NodeId};

/// The result of a weak-controllability check.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum WeakControllability {
    /// There is a schedule for every choice of durations.
    Controllable,
    /// There is no schedule for these durations.
    Uncontrollable(WeakConflict),
    /// The limit on branches was reached before the check was finished.
    Undecided {
        /// Number of branches that were examined.
        branches: usize,
    },
}

/// Durations without a schedule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeakConflict {
    /// The links in the conflict with their durations; the others may have any duration.
    pub durations: BTreeMap<LinkId, Rational>,
    /// The contradiction, in the order of a cycle.
    pub steps: Vec<WeakStep>,
    /// Length of the cycle; negative.
    pub total: Rational,
}

/// `to - from <= bound`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeakStep {
    /// The time point that is subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// The upper bound of the difference.
    pub bound: Rational,
    /// Origin of the bound.
    pub ground: StepGround,
}

/// The ground of one step of a conflict.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum StepGround {
    /// A requirement.
    Requirement(ConstraintId),
    /// The duration of a link.
    Link(LinkId),
}

/// Decides weak controllability: for all durations within their bounds there is a schedule. Returns
/// [`Weak::Undecided`] after `most_branches` branches.
pub fn weak(network: &UncertainNetwork<Rational>, most_branches: usize) -> WeakControllability {
    if let Some(conflict) =
        unbounded_link_conflict(network).or_else(|| own_requirement_conflict(network))
    {
        return WeakControllability::Uncontrollable(conflict);
    }
    match corner_without_schedule(network, most_branches) {
        Ok(None) => WeakControllability::Controllable,
        Err(TooManyBranches) => WeakControllability::Undecided {
            branches: most_branches,
        },
        Ok(Some(sides)) => {
            let durations = sides
                .into_iter()
                .map(|(link, side)| (link, duration(network.link(link), side)))
                .collect();
            match conflict_with(network, &durations) {
                Some(conflict) => WeakControllability::Uncontrollable(conflict),
                // Unreachable: every corner found has a negative cycle.
                None => WeakControllability::Undecided { branches: 0 },
            }
        }
    }
}

/// Returns the contradiction that results from these durations, if any. Links that are not listed
/// add no constraints.
pub fn conflict_with(
    network: &UncertainNetwork<Rational>,
    durations: &BTreeMap<LinkId, Rational>,
) -> Option<WeakConflict> {
    let requirements = network.requirements();
    let mut corner = Network::with_nodes(requirements.node_count());
    let mut given = Vec::new();
    for id in requirements.constraint_ids() {
        corner.add(requirements.constraint(id).clone());
        given.push(StepGround::Requirement(id));
    }
    for (&id, duration) in durations {
        let link = network.link(id);
        corner.add(Constraint::at_most(
            link.activation,
            link.end,
            duration.clone(),
        ));
        corner.add(Constraint::at_least(
            link.activation,
            link.end,
            duration.clone(),
        ));
        given.extend([StepGround::Link(id); 2]);
    }
    let cycle = corner.consistency().err()?;
    let steps = cycle.constraints.iter().map(|&id| {
        let constraint = corner.constraint(id);
        WeakStep {
            from: constraint.from,
            to: constraint.to,
            bound: constraint.bound.clone(),
            ground: given[id.index()],
        }
    });
    let steps: Vec<WeakStep> = steps.collect();
    let is_used = |id: &LinkId| {
        steps
            .iter()
            .any(|step| step.ground == StepGround::Link(*id))
    };
    let used = durations.iter().filter(|(id, _)| is_used(id));
    Some(WeakConflict {
        durations: used.map(|(&id, duration)| (id, duration.clone())).collect(),
        steps,
        total: cycle.total,
    })
}

/// Returns the duration of the link at that end.
fn duration(link: &ContingentLink<Rational>, side: Side) -> Rational {
    match side {
        Side::Lower => link.lower.clone(),
        Side::Upper => link.upper.clone().unwrap_or_else(|| link.lower.clone()),
    }
}

/// Returns a conflict of a link without an upper bound whose end is limited from above.
fn unbounded_link_conflict(network: &UncertainNetwork<Rational>) -> Option<WeakConflict> {
    let shortest: BTreeMap<LinkId, Rational> = network
        .link_ids()
        .map(|id| (id, network.link(id).lower.clone()))
        .collect();
    for id in network.link_ids() {
        let link = network.link(id);
        if link.upper.is_some() || !is_limited(network, id) {
            continue;
        }
        if let Some(conflict) = conflict_with(network, &shortest) {
            return Some(conflict);
        }
        // Lengthens the duration until it exceeds the path from the link's beginning to its end.
        let mut durations = shortest.clone();
        let mut step = Rational::ONE;
        loop {
            durations.insert(id, &link.lower + &step);
            if let Some(conflict) = conflict_with(network, &durations) {
                return Some(conflict);
            }
            step = &step + &step;
        }
    }
    None
}

/// Returns `true` if bounds lead from the activation of a link to its end without the link itself.
fn is_limited(network: &UncertainNetwork<Rational>, id: LinkId) -> bool {
    let link = network.link(id);
    let requirements = network.requirements();
    let mut next: Vec<Vec<NodeId>> = vec![Vec::new(); requirements.node_count()];
    for constraint in requirements.constraints() {
        next[constraint.from.index()].push(constraint.to);
    }
    for other in network.link_ids().filter(|&other| other != id) {
        let other = network.link(other);
        next[other.activation.index()].push(other.end);
        next[other.end.index()].push(other.activation);
    }
    let mut is_seen = vec![false; next.len()];
    let mut stack = vec![link.activation];
    while let Some(node) = stack.pop() {
        if !std::mem::replace(&mut is_seen[node.index()], true) {
            stack.extend(&next[node.index()]);
        }
    }
    is_seen[link.end.index()]
}

/// Returns a conflict of a link with a requirement on the same difference.
fn own_requirement_conflict(network: &UncertainNetwork<Rational>) -> Option<WeakConflict> {
    for constraint in network.requirements().constraints() {
        for (node, other, side) in [
            (constraint.to, constraint.from, Side::Upper),
            (constraint.from, constraint.to, Side::Lower),
        ] {
            let Some(id) = network.ending_at(node) else {
                continue;
            };
            let link = network.link(id);
            let worst = duration(link, side);
            let is_broken = match side {
                Side::Upper => worst > constraint.bound,
                Side::Lower => -&worst > constraint.bound,
            };
            if link.activation == other && is_broken {
                return conflict_with(network, &BTreeMap::from([(id, worst)]));
            }
        }
    }
    None
}

/// Returns a corner without a schedule: the relevant links, with the end of each.
fn corner_without_schedule(
    network: &UncertainNetwork<Rational>,
    most_branches: usize,
) -> Result<Option<Corner<LinkId>>, TooManyBranches> {
    let mut bounds = bounds(network);
    let node_count = network.requirements().node_count();
    let mut all = Network::with_nodes(node_count);
    for bound in &bounds {
        all.add(Constraint::at_most(bound.from, bound.to, Rational::ZERO));
    }
    let component = all.components();
    bounds.retain(|bound| component[bound.from.index()] == component[bound.to.index()]);
    let branching = Branching {
        bounds,
        node_count,
        is_pair: &|_| true,
        value: &|link, side| duration(network.link(link), side),
        most_branches,
    };
    let mut corner = branching.corner_without_schedule()?;
    if let Some(corner) = &mut corner {
        // Links with a single duration, or without an upper bound, are not branched on.
        for id in network.link_ids() {
            let link = network.link(id);
            if link.upper.as_ref().is_none_or(|upper| *upper == link.lower) {
                corner.insert(id, Side::Lower);
            }
        }
    }
    Ok(corner)
}

/// Returns the bounds of the network; those of links depend on their durations.
fn bounds(network: &UncertainNetwork<Rational>) -> Vec<OpenBound<LinkId>> {
    let mut bounds = Vec::new();
    for constraint in network.requirements().constraints() {
        // The link's own bound on this difference is at least as tight; see `own_limit`.
        let is_own = [
            (constraint.to, constraint.from),
            (constraint.from, constraint.to),
        ]
        .iter()
        .any(|&(node, other)| {
            let link = network.ending_at(node).map(|id| network.link(id));
            link.is_some_and(|link| link.activation == other)
        });
        if !is_own {
            bounds.push(OpenBound {
                from: constraint.from,
                to: constraint.to,
                constant: constraint.bound.clone(),
                quantity: None,
            });
        }
    }
    for id in network.link_ids() {
        let link = network.link(id);
        if link.upper.is_none() {
            // A link without an upper bound lies on no cycle in the other direction; see `endless`.
            bounds.push(OpenBound {
                from: link.activation,
                to: link.end,
                constant: link.lower.clone(),
                quantity: None,
            });
            continue;
        }
        for (from, to, side) in [
            (link.activation, link.end, Side::Upper),
            (link.end, link.activation, Side::Lower),
        ] {
            bounds.push(OpenBound {
                from,
                to,
                constant: Rational::ZERO,
                quantity: Some((id, side)),
            });
        }
    }
    bounds
}
