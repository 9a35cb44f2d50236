//! The first half of the box check: there is a schedule for every value in the box.

mod rules;

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::reduction::{Edge, Reduction};
use elbowroom_num::{Interval, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side, Valuation};
use elbowroom_stn::corner_search::{Branching, OpenBound, TooManyBranches};
use elbowroom_stn::{ConsistentNetwork, Constraint, Network};

use crate::cycles::{Cycles, Role, reach_limits};

/// Limit on corners that are kept from one box to the next. If there are more, [`Branching`]
/// searches for the relevant ones.
const MAX_CORNERS: usize = 1 << 8;

/// Limit on branches that [`Branching`] examines before the check is undecided.
pub(crate) const MAX_BRANCHES: usize = 1 << 14;

/// Feasibility check: a plan's network has a schedule for every value in a box (weak
/// controllability).
///
/// The values that have a schedule form a convex set, so it is enough to check the corners of the
/// box. Few corners are needed: a parameter matters only through cycles of constraints. If all
/// cycles through it traverse its constraint in one direction, only one of its ends matters, and
/// that end is known beforehand. In deordered plans almost every parameter is of this kind. For an
/// infinite end, the check is whether the set of values with a schedule is unbounded on that side.
///
/// A parameter that *is* a difference of times may have further bounds on the same difference (an
/// action whose start and end interfere takes at least ε). These bounds limit the parameter,
/// independently of the others, and have no other effect. They are checked separately
/// ([`own_limits`](Self::own_limits)).
#[derive(Clone, Debug)]
pub(crate) struct Feasibility {
    /// The reduced network's edges.
    all_edges: Arc<Vec<Edge>>,
    /// The positions of the edges that are not limits of a parameter.
    left: Vec<u32>,
    /// Limits on the reach of single ends ([`BoxEnd::reach`]).
    own_limits: BTreeMap<BoxEnd, Rational>,
    class_count: usize,
    /// Each parameter's role in the cycles of these edges.
    roles: Vec<Role>,
    /// Parameters that bound several differences.
    coupled: Vec<ParameterId>,
    /// `true` if there are too many corners to keep.
    branches: bool,
    corners: Vec<Corner>,
}

/// A choice of ends, and the network there.
#[derive(Clone, Debug)]
struct Corner {
    sides: BTreeMap<ParameterId, Side>,
    network: ConsistentNetwork,
}

/// Values in the box for which there is no schedule.
#[derive(Clone, Debug)]
pub(crate) enum Infeasible {
    /// These values.
    At(Valuation),
    /// Some values far out on that side, whatever the other parameters are.
    BeyondLimit(BoxEnd),
}

impl Feasibility {
    pub(crate) fn new(plan: &ParametrizedPlan, reduction: &Reduction) -> Self {
        let all_edges = reduction.shared_edges();
        let class_count = reduction.class_count();
        let (own_limits, left) = reach_limits(&all_edges, &reduction.coupled);
        let edges = left.iter().map(|&index| &all_edges[index as usize]);
        let cycles = Cycles::new(edges.collect(), class_count);
        let roles: Vec<Role> = (0..plan.parameters.len())
            .map(ParameterId::from)
            .map(|id| {
                if reduction.coupled.contains(&id) {
                    Role::Both
                } else {
                    cycles.role(id)
                }
            })
            .collect();
        let both = roles.iter().filter(|&&role| role == Role::Both).count();
        Self {
            all_edges,
            left,
            own_limits,
            class_count,
            roles,
            coupled: reduction.coupled.clone(),
            branches: both > MAX_CORNERS.ilog2() as usize,
            corners: Vec::new(),
        }
    }

    /// Returns the edges that are not limits of a parameter.
    fn edges(&self) -> impl Iterator<Item = &Edge> + Clone {
        self.left
            .iter()
            .map(|&index| &self.all_edges[index as usize])
    }

    /// Returns values in the box without a schedule, if any.
    ///
    /// If `moved` is given, the box differs from the last feasible one only in that end, which is
    /// further out.
    pub(crate) fn infeasible(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: Option<BoxEnd>,
    ) -> Result<Option<Infeasible>, TooManyBranches> {
        let ends = match moved {
            Some(end) => vec![end],
            None => BoxEnd::all(envelope.intervals().len()).collect(),
        };
        for end in ends {
            match (end.reach(envelope), self.own_limits.get(&end)) {
                (None, _) if !self.is_unlimited(end) => {
                    return Ok(Some(Infeasible::BeyondLimit(end)));
                }
                (Some(reach), Some(limit)) if reach > *limit => {
                    let sides = BTreeMap::from([(end.parameter, end.side)]);
                    return Ok(Some(Infeasible::At(valuation(&sides, envelope))));
                }
                _ => {}
            }
        }
        if self.branches {
            let corner = self.branching(envelope)?;
            return Ok(corner.map(|sides| Infeasible::At(valuation(&sides, envelope))));
        }
        Ok(match moved {
            Some(end) if !self.corners.is_empty() => self.tighten(envelope, end, true),
            _ => self.rebuild(envelope),
        })
    }

    /// Does the same for a box that differs from the last feasible one only in `moved`, and keeps
    /// the last feasible box.
    pub(crate) fn infeasible_if_moved(
        &mut self,
        envelope: &DecoupledEnvelope,
        moved: BoxEnd,
    ) -> Result<Option<Infeasible>, TooManyBranches> {
        if self.branches || self.corners.is_empty() || self.is_beyond_limit(envelope, moved) {
            return self.clone().infeasible(envelope, Some(moved));
        }
        Ok(self.tighten(envelope, moved, false))
    }

    /// Returns `true` if the end is beyond a limit that applies to it alone.
    fn is_beyond_limit(&self, envelope: &DecoupledEnvelope, end: BoxEnd) -> bool {
        self.is_too_far(end, end.reach(envelope).as_ref())
    }

    /// Returns `true` if every box with this end at that reach contains values without a schedule,
    /// whatever its other ends. `None` is infinitely far.
    pub(crate) fn is_too_far(&self, end: BoxEnd, reach: Option<&Rational>) -> bool {
        match reach {
            None => !self.is_unlimited(end),
            Some(reach) => self.own_limits.get(&end).is_some_and(|limit| reach > limit),
        }
    }

    /// Returns a corner without a schedule.
    fn branching(
        &self,
        envelope: &DecoupledEnvelope,
    ) -> Result<Option<BTreeMap<ParameterId, Side>>, TooManyBranches> {
        let bounds = self.edges().filter(|edge| self.is_on_cycle(edge));
        let bounds = bounds.map(|edge| OpenBound {
            from: edge.from,
            to: edge.to,
            constant: edge.constant.clone(),
            quantity: edge.end.map(|end| (end.parameter, end.side)),
        });
        let network = Branching {
            bounds: bounds.collect(),
            node_count: self.class_count,
            is_pair: &|parameter| !self.coupled.contains(&parameter),
            value: &|parameter, side| end_or_finite(envelope.interval(parameter), side),
            most_branches: MAX_BRANCHES,
        };
        network.corner_without_schedule()
    }

    /// Returns `true` if an edge lies on a cycle. An edge with the bound "at most the parameter"
    /// lies on cycles that small values of the parameter make negative.
    fn is_on_cycle(&self, edge: &Edge) -> bool {
        edge.end.is_none_or(|end| {
            matches!(
                (self.roles[end.parameter.index()], end.side),
                (Role::Both, _) | (Role::Lower, Side::Upper) | (Role::Upper, Side::Lower)
            )
        })
    }

    /// Returns `true` if the parameter can move out on that side without limit, from any values
    /// that have a schedule.
    ///
    /// The values that have a schedule form a polyhedron. It is unbounded in a direction exactly if
    /// the network has a schedule when each bound is replaced by the change in that direction.
    fn is_unlimited(&self, end: BoxEnd) -> bool {
        if self.own_limits.contains_key(&end) {
            return false;
        }
        if !self.coupled.contains(&end.parameter) {
            return match self.roles[end.parameter.index()] {
                Role::None => true,
                Role::Lower => end.side == Side::Upper,
                Role::Upper => end.side == Side::Lower,
                Role::Both => false,
            };
        }
        let mut network = Network::with_nodes(self.class_count);
        for edge in self.edges() {
            // An upper bound increases with the parameter, a lower bound decreases the edge.
            let bound = match edge.end {
                Some(other) if other.parameter == end.parameter && other.side == end.side => 1,
                Some(other) if other.parameter == end.parameter => -1,
                _ => 0,
            };
            network.add(Constraint {
                from: edge.from,
                to: edge.to,
                bound: Rational::from(bound),
            });
        }
        ConsistentNetwork::try_from(network).is_ok()
    }

    /// Converts the finding to values.
    pub(crate) fn values(&self, envelope: &DecoupledEnvelope, found: Infeasible) -> Valuation {
        match found {
            Infeasible::At(values) => values,
            Infeasible::BeyondLimit(end) => self.far_values(envelope, end),
        }
    }

    /// Returns values without a schedule, with the parameter as far out on that side as necessary.
    fn far_values(&self, envelope: &DecoupledEnvelope, end: BoxEnd) -> Valuation {
        let mut values: Valuation = envelope
            .intervals()
            .iter()
            .map(|interval| end_or_finite(interval, Side::Lower))
            .collect();
        let base = end_or_finite(envelope.interval(end.parameter), end.side.opposite());
        let mut step = Rational::ONE;
        loop {
            values[end.parameter] = match end.side {
                Side::Lower => &base - &step,
                Side::Upper => &base + &step,
            };
            let point = DecoupledEnvelope::point(&values);
            if self
                .network_where(self.all_edges.iter(), |edge| edge.bound(&point))
                .is_none()
            {
                return values;
            }
            step = &step + &step;
        }
    }

    fn rebuild(&mut self, envelope: &DecoupledEnvelope) -> Option<Infeasible> {
        let mut corners: Vec<BTreeMap<ParameterId, Side>> = vec![BTreeMap::new()];
        for (index, role) in self.roles.iter().enumerate() {
            let sides: &[Side] = match role {
                Role::None => continue,
                Role::Lower => &[Side::Lower],
                Role::Upper => &[Side::Upper],
                Role::Both => &Side::BOTH,
            };
            let id = ParameterId::from(index);
            // Most parameters have one side: a copy of each corner for each of them would take
            // quadratic time.
            if let [side] = *sides {
                for corner in &mut corners {
                    corner.insert(id, side);
                }
                continue;
            }
            let doubled = corners.into_iter().flat_map(|corner| {
                sides.iter().map(move |&side| {
                    let mut corner = corner.clone();
                    corner.insert(id, side);
                    corner
                })
            });
            corners = doubled.collect();
        }
        let mut built = Vec::with_capacity(corners.len());
        for sides in corners {
            match self.network(&sides, envelope) {
                Some(network) => built.push(Corner { sides, network }),
                None => return Some(Infeasible::At(valuation(&sides, envelope))),
            }
        }
        self.corners = built;
        None
    }

    /// Returns the network at a corner, if it is consistent.
    fn network(
        &self,
        sides: &BTreeMap<ParameterId, Side>,
        envelope: &DecoupledEnvelope,
    ) -> Option<ConsistentNetwork> {
        self.network_where(self.edges(), |edge| self.bound(edge, sides, envelope))
    }

    /// Returns the network with these bounds, if it is consistent; `None` means no bound.
    fn network_where<'a>(
        &self,
        edges: impl Iterator<Item = &'a Edge>,
        bound: impl Fn(&Edge) -> Option<Rational>,
    ) -> Option<ConsistentNetwork> {
        let mut network = Network::with_nodes(self.class_count);
        for edge in edges {
            if let Some(bound) = bound(edge) {
                network.add(Constraint {
                    from: edge.from,
                    to: edge.to,
                    bound,
                });
            }
        }
        ConsistentNetwork::try_from(network).ok()
    }

    /// Returns the bound of an edge at a corner of the box; `None` if the edge does not matter.
    fn bound(
        &self,
        edge: &Edge,
        sides: &BTreeMap<ParameterId, Side>,
        envelope: &DecoupledEnvelope,
    ) -> Option<Rational> {
        let Some(end) = edge.end else {
            return Some(edge.constant.clone());
        };
        let (true, Some(&side)) = (self.is_on_cycle(edge), sides.get(&end.parameter)) else {
            return None;
        };
        let value = end_or_finite(envelope.interval(end.parameter), side);
        Some(match end.side {
            Side::Upper => &edge.constant + value,
            Side::Lower => &edge.constant - value,
        })
    }

    /// Moves one end further out in all corners that use it; all of them or none. The networks stay
    /// as they were unless `keep` is set.
    fn tighten(
        &mut self,
        envelope: &DecoupledEnvelope,
        end: BoxEnd,
        keep: bool,
    ) -> Option<Infeasible> {
        let role = self.roles[end.parameter.index()];
        match role {
            Role::None => return None,
            Role::Lower if end.side == Side::Upper => return None,
            Role::Upper if end.side == Side::Lower => return None,
            // Both of a parameter's edges move, and one of them becomes looser, so the networks are
            // rebuilt.
            Role::Both => return self.rebuild_corners(envelope, end, keep),
            Role::Lower | Role::Upper => {}
        }
        let mut tightened = Vec::new();
        for edge in self.edges() {
            if edge
                .end
                .is_none_or(|other| other.parameter != end.parameter)
            {
                continue;
            }
            let sides = BTreeMap::from([(end.parameter, end.side)]);
            if let Some(bound) = self.bound(edge, &sides, envelope) {
                tightened.push(Constraint {
                    from: edge.from,
                    to: edge.to,
                    bound,
                });
            }
        }
        let checkpoints: Vec<_> = self
            .corners
            .iter()
            .map(|corner| corner.network.checkpoint())
            .collect();
        let refused = self.corners.iter_mut().find_map(|corner| {
            let mut added = tightened.iter().map(|own| corner.network.add(own.clone()));
            let is_refused = added.any(|added| added.is_err());
            is_refused.then(|| valuation(&corner.sides, envelope))
        });
        if refused.is_some() || !keep {
            for (corner, checkpoint) in self.corners.iter_mut().zip(&checkpoints) {
                corner.network.undo_to(*checkpoint);
            }
        }
        refused.map(Infeasible::At)
    }

    /// Rebuilds the networks of the corners that use the end; all of them or none, and none unless
    /// `keep` is set.
    fn rebuild_corners(
        &mut self,
        envelope: &DecoupledEnvelope,
        end: BoxEnd,
        keep: bool,
    ) -> Option<Infeasible> {
        let mut rebuilt = Vec::new();
        for (index, corner) in self.corners.iter().enumerate() {
            if corner.sides.get(&end.parameter) == Some(&end.side) {
                match self.network(&corner.sides, envelope) {
                    Some(network) => rebuilt.push((index, network)),
                    None => return Some(Infeasible::At(valuation(&corner.sides, envelope))),
                }
            }
        }
        for (index, network) in rebuilt.into_iter().filter(|_| keep) {
            self.corners[index].network = network;
        }
        None
    }
}

/// Returns the values at a corner; parameters that do not matter have any value.
fn valuation(sides: &BTreeMap<ParameterId, Side>, envelope: &DecoupledEnvelope) -> Valuation {
    let mut sides = sides.iter().peekable();
    let intervals = envelope.intervals().iter().enumerate();
    intervals
        .map(|(index, interval)| {
            let own = sides.next_if(|(id, _)| **id == ParameterId::from(index));
            end_or_finite(interval, own.map_or(Side::Lower, |(_, side)| *side))
        })
        .collect()
}

/// Returns that end of the interval or, if it is infinite, some value in it. Whether the plan has
/// schedules arbitrarily far in that direction is checked separately.
fn end_or_finite(interval: &Interval, side: Side) -> Rational {
    let (wanted, other) = (side.of(interval), side.opposite().of(interval));
    let value = wanted.value().or(other.value());
    value.cloned().unwrap_or_default()
}
