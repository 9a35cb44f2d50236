//! The first half of the box check: for every value in the box there is a schedule.

use std::collections::BTreeMap;

use elbowroom_num::Rational;
use elbowroom_plan::reduction::{BoxEnd, Edge, Reduction, Side};
use elbowroom_plan::{DecoupledEnvelope, ParameterId, ParametrizedPlan, Valuation};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network};

/// How many corners are looked at before the question is given up.
pub(crate) const MOST_CORNERS: usize = 1 << 14;

/// Whether a plan's network has a schedule for every value in a box (weak controllability).
///
/// The values for which it has one form a convex set, so the corners of the box decide. Few of
/// them need looking at: a parameter matters only through cycles of constraints. If all cycles
/// through it walk its constraint one way, only one of its ends counts, and that end is known
/// beforehand. In deordered plans almost every parameter is like that.
#[derive(Clone, Debug)]
pub(crate) struct Feasibility {
    /// The reduced network's edges, and each parameter's role in its cycles.
    edges: Vec<Edge>,
    class_count: usize,
    roles: Vec<Role>,
    corners: Vec<Corner>,
}

/// Through which of its ends a parameter can make the network inconsistent.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// It is on no cycle.
    None,
    /// Small values break things: it is only used as an upper bound.
    Lower,
    /// Large values break things: it is only used as a lower bound.
    Upper,
    /// Both can.
    Both,
}

/// A choice of ends, and the network there.
#[derive(Clone, Debug)]
struct Corner {
    sides: BTreeMap<ParameterId, Side>,
    network: ConsistentNetwork,
}

/// Values in the box for which there is no schedule.
pub(crate) type Infeasible = Valuation;

/// Too many parameters are on cycles both ways.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooManyCorners;

impl Feasibility {
    pub(crate) fn new(
        plan: &ParametrizedPlan,
        reduction: &Reduction,
    ) -> Result<Self, TooManyCorners> {
        let edges = reduction.edges().to_vec();
        let class_count = reduction.class_count();
        let roles: Vec<Role> = (0..plan.parameters.len())
            .map(ParameterId::from)
            .map(|id| {
                if reduction.coupled.contains(&id) {
                    Role::Both
                } else {
                    role(&edges, class_count, id)
                }
            })
            .collect();
        let both = roles.iter().filter(|&&role| role == Role::Both).count();
        if both > MOST_CORNERS.ilog2() as usize {
            return Err(TooManyCorners);
        }
        Ok(Self {
            edges,
            class_count,
            roles,
            corners: Vec::new(),
        })
    }

    /// Values in the box without a schedule, if any.
    ///
    /// `moved` says that the box differs only in that end, further out, from the last one that was
    /// found feasible.
    pub(crate) fn infeasible(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Option<Infeasible> {
        match moved {
            Some(end) if !self.corners.is_empty() => self.tighten(envelope, end),
            _ => self.rebuild(envelope),
        }
    }

    fn rebuild(&mut self, envelope: &DecoupledEnvelope) -> Option<Infeasible> {
        let mut corners = vec![BTreeMap::new()];
        for (index, role) in self.roles.iter().enumerate() {
            let sides: &[Side] = match role {
                Role::None => continue,
                Role::Lower => &[Side::Lower],
                Role::Upper => &[Side::Upper],
                Role::Both => &[Side::Lower, Side::Upper],
            };
            let id = ParameterId::from(index);
            corners = corners
                .iter()
                .flat_map(|corner: &BTreeMap<ParameterId, Side>| {
                    sides.iter().map(move |&side| {
                        let mut corner = corner.clone();
                        corner.insert(id, side);
                        corner
                    })
                })
                .collect();
        }
        let mut built = Vec::with_capacity(corners.len());
        for sides in corners {
            match self.network(&sides, envelope) {
                Some(network) => built.push(Corner { sides, network }),
                None => return Some(valuation(&sides, envelope)),
            }
        }
        self.corners = built;
        None
    }

    /// The network at a corner, if it is consistent.
    fn network(
        &self,
        sides: &BTreeMap<ParameterId, Side>,
        envelope: &DecoupledEnvelope,
    ) -> Option<ConsistentNetwork> {
        let mut network = Network::with_nodes(self.class_count);
        for edge in &self.edges {
            match self.bound(edge, sides, envelope) {
                EdgeBound::Unused => {}
                EdgeBound::At(bound) => {
                    network.add(Constraint {
                        from: edge.from,
                        to: edge.to,
                        bound,
                    });
                }
                EdgeBound::Impossible => return None,
            }
        }
        ConsistentNetwork::try_from(network).ok()
    }

    /// What an edge demands at a corner.
    fn bound(
        &self,
        edge: &Edge,
        sides: &BTreeMap<ParameterId, Side>,
        envelope: &DecoupledEnvelope,
    ) -> EdgeBound {
        let Some(end) = edge.end else {
            return EdgeBound::At(edge.constant.clone());
        };
        // An edge that says "at most the parameter" lies on cycles that small values break.
        let matters = match (self.roles[end.parameter.index()], end.side) {
            (Role::Both, _) | (Role::Lower, Side::Upper) | (Role::Upper, Side::Lower) => true,
            (Role::None | Role::Lower | Role::Upper, _) => false,
        };
        let (true, Some(&side)) = (matters, sides.get(&end.parameter)) else {
            return EdgeBound::Unused;
        };
        let interval = envelope.interval(end.parameter);
        let value = match side {
            Side::Lower => interval.lower.value(),
            Side::Upper => interval.upper.value(),
        };
        match (value, end.side) {
            (Some(value), Side::Upper) => EdgeBound::At(&edge.constant + value),
            (Some(value), Side::Lower) => EdgeBound::At(&edge.constant - value),
            // The edge is on a cycle, and its bound can be arbitrarily tight.
            (None, _) => EdgeBound::Impossible,
        }
    }

    /// Moves one end further out in all corners that use it; all of them or none.
    fn tighten(&mut self, envelope: &DecoupledEnvelope, end: BoxEnd) -> Option<Infeasible> {
        let role = self.roles[end.parameter.index()];
        match role {
            Role::None => return None,
            Role::Lower if end.side == Side::Upper => return None,
            Role::Upper if end.side == Side::Lower => return None,
            // Both of a parameter's edges move, one of them to looser: start afresh.
            Role::Both => return self.rebuild_corners(envelope, end),
            Role::Lower | Role::Upper => {}
        }
        let mut tightened = Vec::new();
        for edge in &self.edges {
            if edge
                .end
                .is_none_or(|other| other.parameter != end.parameter)
            {
                continue;
            }
            let sides = BTreeMap::from([(end.parameter, end.side)]);
            match self.bound(edge, &sides, envelope) {
                EdgeBound::Unused => {}
                EdgeBound::At(bound) => {
                    tightened.push(Constraint {
                        from: edge.from,
                        to: edge.to,
                        bound,
                    });
                }
                EdgeBound::Impossible => {
                    let sides = self.corners.first().map(|corner| &corner.sides);
                    return Some(sides.map_or_else(Vec::new, |s| valuation(s, envelope)));
                }
            }
        }
        let checkpoints: Vec<_> = self
            .corners
            .iter()
            .map(|corner| corner.network.checkpoint())
            .collect();
        for index in 0..self.corners.len() {
            for constraint in &tightened {
                if self.corners[index].network.add(constraint.clone()).is_err() {
                    let values = valuation(&self.corners[index].sides, envelope);
                    for (corner, checkpoint) in self.corners.iter_mut().zip(&checkpoints) {
                        corner.network.undo_to(*checkpoint);
                    }
                    return Some(values);
                }
            }
        }
        None
    }

    /// The networks of the corners that use the end, made anew; all of them or none.
    fn rebuild_corners(&mut self, envelope: &DecoupledEnvelope, end: BoxEnd) -> Option<Infeasible> {
        let mut rebuilt = Vec::new();
        for (index, corner) in self.corners.iter().enumerate() {
            if corner.sides.get(&end.parameter) == Some(&end.side) {
                match self.network(&corner.sides, envelope) {
                    Some(network) => rebuilt.push((index, network)),
                    None => return Some(valuation(&corner.sides, envelope)),
                }
            }
        }
        for (index, network) in rebuilt {
            self.corners[index].network = network;
        }
        None
    }
}

/// What an edge demands at a corner.
enum EdgeBound {
    /// Nothing that matters.
    Unused,
    /// A bound.
    At(Rational),
    /// More than any schedule can satisfy.
    Impossible,
}

/// The values at a corner; parameters that do not matter, and infinite ends, at some value.
fn valuation(sides: &BTreeMap<ParameterId, Side>, envelope: &DecoupledEnvelope) -> Valuation {
    envelope
        .intervals
        .iter()
        .enumerate()
        .map(|(index, interval)| {
            let (lower, upper) = (interval.lower.value(), interval.upper.value());
            let (wanted, other) = match sides.get(&ParameterId::from(index)) {
                Some(Side::Upper) => (upper, lower),
                Some(Side::Lower) | None => (lower, upper),
            };
            // A value beyond all others in the plan shows an infinite end at work.
            let far = || Rational::from(1_000_000_000_i64);
            match (wanted, other) {
                (Some(value), _) => value.clone(),
                (None, Some(other)) => match sides.get(&ParameterId::from(index)) {
                    Some(Side::Upper) => other + &far(),
                    _ => other - &far(),
                },
                (None, None) => far(),
            }
        })
        .collect()
}

/// How an uncoupled parameter lies on cycles. Its edges are one `s -> d` ("at most") and one
/// `d -> s` ("at least"), or only one of them; going there and back along both says nothing.
fn role(edges: &[Edge], class_count: usize, parameter: ParameterId) -> Role {
    let own = |edge: &Edge| edge.end.is_some_and(|end| end.parameter == parameter);
    let mut successors: Vec<Vec<usize>> = vec![Vec::new(); class_count];
    for edge in edges.iter().filter(|edge| !own(edge)) {
        successors[edge.from.index()].push(edge.to.index());
    }
    let reaches = |from: usize, to: usize| {
        let mut seen = vec![false; class_count];
        let mut stack = vec![from];
        while let Some(node) = stack.pop() {
            if node == to {
                return true;
            }
            if !std::mem::replace(&mut seen[node], true) {
                stack.extend(&successors[node]);
            }
        }
        false
    };
    let on_cycle = |side: Side| {
        edges.iter().filter(|edge| own(edge)).any(|edge| {
            edge.end.is_some_and(|end| end.side == side)
                && reaches(edge.to.index(), edge.from.index())
        })
    };
    match (on_cycle(Side::Upper), on_cycle(Side::Lower)) {
        (false, false) => Role::None,
        (true, false) => Role::Lower,
        (false, true) => Role::Upper,
        (true, true) => Role::Both,
    }
}
