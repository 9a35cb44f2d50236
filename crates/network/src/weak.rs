//! Is there a schedule for whatever the world does?
//!
//! Weak controllability (Vidal & Fargier 1999): for each choice of durations of the contingent
//! links there are times for the other points, perhaps such that had to know the durations
//! beforehand. The durations with a schedule form a convex set, so the corners decide, where each
//! link is as short or as long as it may be. There are 2ⁿ of them, and nothing avoids that
//! altogether: the question is co-NP-complete (Morris & Muscettola 1999). But few links need both
//! ends looked at:
//!
//! 1. Each link is first taken at its worst on both sides: it ends early and it ends late. If no
//!    cycle is negative even so, there is always a schedule.
//! 2. A negative cycle that takes no link both ways is a corner without a schedule.
//! 3. Only where a negative cycle takes a link both ways, that link is set to the one end, and
//!    then to the other.
//!
//! No simple cycle takes a link there and straight back, so walks that do are not looked at.
//! A link that may last for ever needs no branching: if anything at all limits its end from
//! above, some duration is too long.

mod walks;

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_stn::uncertain::{ContingentLink, LinkId, UncertainNetwork};
use elbowroom_stn::{Constraint, ConstraintId, Network, NodeId};

use walks::Walks;

/// What the bounds of a network say about weak controllability.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Weak {
    /// There is a schedule for whatever the world does.
    Controllable,
    /// For these durations there is none.
    Uncontrollable(WeakConflict),
    /// It takes more than so many branches to find out.
    Undecided {
        /// How many were looked at.
        branches: usize,
    },
}

/// Durations without a schedule.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeakConflict {
    /// The links that matter, and how long each takes; the others may take any time.
    pub durations: BTreeMap<LinkId, Rational>,
    /// What contradicts itself then, in the order of a cycle.
    pub steps: Vec<WeakStep>,
    /// By how much; negative.
    pub total: Rational,
}

/// `to - from <= bound`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WeakStep {
    /// The time point that is subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// What the difference does not exceed.
    pub bound: Rational,
    /// Where it comes from.
    pub given: Given,
}

/// What a step goes by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Given {
    /// A requirement.
    Requirement(ConstraintId),
    /// The duration of a link.
    Link(LinkId),
}

/// One end of what a link may take.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Lower,
    Upper,
}

/// Whether there is a schedule for whatever the world does; after `most_branches` the question is
/// given up.
pub fn weak(network: &UncertainNetwork<Rational>, most_branches: usize) -> Weak {
    if let Some(conflict) = endless(network).or_else(|| own_limit(network)) {
        return Weak::Uncontrollable(conflict);
    }
    let mut branching = Branching::new(network);
    match branching.corner_without_schedule(most_branches) {
        Found::None => Weak::Controllable,
        Found::TooMany => Weak::Undecided {
            branches: most_branches,
        },
        Found::Corner(sides) => {
            let durations = sides
                .into_iter()
                .map(|(link, side)| (link, duration(network.link(link), side)))
                .collect();
            match at(network, &durations) {
                Some(conflict) => Weak::Uncontrollable(conflict),
                // Every corner found has a negative cycle; were it not so, nothing would be known.
                None => Weak::Undecided { branches: 0 },
            }
        }
    }
}

/// What contradicts itself if these links take so long, if something does. Links that are not
/// mentioned limit nothing.
pub fn at(
    network: &UncertainNetwork<Rational>,
    durations: &BTreeMap<LinkId, Rational>,
) -> Option<WeakConflict> {
    let requirements = network.requirements();
    let mut corner = Network::with_nodes(requirements.node_count());
    let mut given = Vec::new();
    for id in requirements.constraint_ids() {
        corner.add(requirements.constraint(id).clone());
        given.push(Given::Requirement(id));
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
        given.extend([Given::Link(id); 2]);
    }
    let cycle = corner.consistency().err()?;
    let steps = cycle.constraints.iter().map(|&id| {
        let constraint = corner.constraint(id);
        WeakStep {
            from: constraint.from,
            to: constraint.to,
            bound: constraint.bound.clone(),
            given: given[id.index()],
        }
    });
    let steps: Vec<WeakStep> = steps.collect();
    let is_used = |id: &LinkId| steps.iter().any(|step| step.given == Given::Link(*id));
    let used = durations.iter().filter(|(id, _)| is_used(id));
    Some(WeakConflict {
        durations: used.map(|(&id, duration)| (id, duration.clone())).collect(),
        steps,
        total: cycle.total,
    })
}

/// How long a link takes at that end.
fn duration(link: &ContingentLink<Rational>, side: Side) -> Rational {
    match side {
        Side::Lower => link.lower.clone(),
        Side::Upper => link.upper.clone().unwrap_or_else(|| link.lower.clone()),
    }
}

/// A conflict of a link without an upper bound whose end is limited from above.
fn endless(network: &UncertainNetwork<Rational>) -> Option<WeakConflict> {
    let shortest: BTreeMap<LinkId, Rational> = network
        .link_ids()
        .map(|id| (id, network.link(id).lower.clone()))
        .collect();
    for id in network.link_ids() {
        let link = network.link(id);
        if link.upper.is_some() || !is_limited(network, id) {
            continue;
        }
        if let Some(conflict) = at(network, &shortest) {
            return Some(conflict);
        }
        // So long that the way from its beginning to its end is shorter.
        let mut durations = shortest.clone();
        let mut step = Rational::ONE;
        loop {
            durations.insert(id, &link.lower + &step);
            if let Some(conflict) = at(network, &durations) {
                return Some(conflict);
            }
            step = &step + &step;
        }
    }
    None
}

/// Whether bounds lead from the beginning of a link to its end without the link itself.
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

/// A conflict of a link with a requirement on the very same difference.
fn own_limit(network: &UncertainNetwork<Rational>) -> Option<WeakConflict> {
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
                return at(network, &BTreeMap::from([(id, worst)]));
            }
        }
    }
    None
}

/// A bound that depends on the duration of a link, or not.
#[derive(Clone, Debug)]
struct Edge {
    from: NodeId,
    to: NodeId,
    /// What it says, where it depends on no link.
    constant: Rational,
    /// The link, and whether its duration bounds from above (`to` is the link's end) or from
    /// below.
    end: Option<(LinkId, Side)>,
}

/// Looks for a corner without a schedule.
struct Branching<'a> {
    network: &'a UncertainNetwork<Rational>,
    edges: Vec<Edge>,
    walks: Walks,
}

/// The ends that links are set to.
type Sides = BTreeMap<LinkId, Side>;

enum Found {
    None,
    Corner(Sides),
    TooMany,
}

impl<'a> Branching<'a> {
    fn new(network: &'a UncertainNetwork<Rational>) -> Self {
        let mut edges = Vec::new();
        for constraint in network.requirements().constraints() {
            // What a link says of its own difference is as tight; see `own_limit`.
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
                edges.push(Edge {
                    from: constraint.from,
                    to: constraint.to,
                    constant: constraint.bound.clone(),
                    end: None,
                });
            }
        }
        for id in network.link_ids() {
            let link = network.link(id);
            let is_point = link.upper.as_ref() == Some(&link.lower);
            let mut push = |from, to, constant, side| {
                edges.push(Edge {
                    from,
                    to,
                    constant,
                    end: (!is_point && link.upper.is_some()).then_some((id, side)),
                });
            };
            push(link.activation, link.end, link.lower.clone(), Side::Upper);
            // The other way, a link that may last for ever lies on no cycle; see `endless`.
            if let Some(upper) = &link.upper {
                push(link.end, link.activation, -upper, Side::Lower);
            }
        }
        let count = network.requirements().node_count();
        let walks = Walks::new(&edges, count);
        Self {
            network,
            edges,
            walks,
        }
    }

    fn corner_without_schedule(&mut self, most_branches: usize) -> Found {
        let mut branches: Vec<Sides> = vec![Sides::new()];
        let mut looked_at = 0;
        while let Some(chosen) = branches.pop() {
            if looked_at == most_branches {
                return Found::TooMany;
            }
            looked_at += 1;
            let weights: Vec<Rational> = self
                .edges
                .iter()
                .map(|edge| self.weight(edge, &chosen))
                .collect();
            let Some(walk) = self.walks.negative(&self.edges, &weights) else {
                continue;
            };
            let mut torn = None;
            for cycle in simple_cycles(&self.edges, &walk) {
                let weight: Rational = cycle.iter().map(|&edge| &weights[edge]).sum();
                if !weight.is_negative() {
                    continue;
                }
                match self.sides(&cycle, &chosen) {
                    Ok(sides) => return Found::Corner(sides),
                    Err(link) => torn = torn.or(Some(link)),
                }
            }
            let torn = torn.expect("a negative walk has a negative cycle");
            for side in [Side::Upper, Side::Lower] {
                let mut branch = chosen.clone();
                branch.insert(torn, side);
                branches.push(branch);
            }
        }
        Found::None
    }

    /// The bound of an edge, at its worst where nothing is chosen.
    fn weight(&self, edge: &Edge, chosen: &Sides) -> Rational {
        let Some((link, side)) = edge.end else {
            return edge.constant.clone();
        };
        let worst = other(side);
        let value = duration(
            self.network.link(link),
            chosen.get(&link).copied().unwrap_or(worst),
        );
        match side {
            Side::Upper => value,
            Side::Lower => -value,
        }
    }

    /// The ends at which a cycle takes its links, beside those chosen before.
    ///
    /// # Errors
    /// A link that it takes at both.
    fn sides(&self, cycle: &[usize], chosen: &Sides) -> Result<Sides, LinkId> {
        let mut sides = chosen.clone();
        for &edge in cycle {
            let Some((link, side)) = self.edges[edge].end else {
                continue;
            };
            if chosen.contains_key(&link) {
                continue;
            }
            let worst = other(side);
            if *sides.entry(link).or_insert(worst) != worst {
                return Err(link);
            }
        }
        // Links of one duration, or without an upper bound, are on the cycle as they are.
        for id in self.network.link_ids() {
            let link = self.network.link(id);
            if link.upper.as_ref().is_none_or(|upper| *upper == link.lower) {
                sides.insert(id, Side::Lower);
            }
        }
        Ok(sides)
    }
}

fn other(side: Side) -> Side {
    match side {
        Side::Lower => Side::Upper,
        Side::Upper => Side::Lower,
    }
}

/// Takes a closed walk apart.
fn simple_cycles(edges: &[Edge], walk: &[usize]) -> Vec<Vec<usize>> {
    let mut cycles = Vec::new();
    // Where on the path each node has been left.
    let mut path: Vec<usize> = Vec::new();
    let mut at: BTreeMap<NodeId, usize> = BTreeMap::new();
    for &edge in walk {
        at.insert(edges[edge].from, path.len());
        path.push(edge);
        if let Some(&start) = at.get(&edges[edge].to) {
            let cycle = path.split_off(start);
            for &edge in &cycle {
                at.remove(&edges[edge].from);
            }
            cycles.push(cycle);
        }
    }
    cycles
}
