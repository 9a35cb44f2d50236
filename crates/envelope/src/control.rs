//! Dynamic and strong controllability of a plan in a box.
//!
//! `elbowroom-stn` checks the plan's network with contingent links for the durations that the world
//! decides on ([`ParametrizedPlan::uncertain_network`]). As with every guarantee,
//! [`Soundness`](crate::soundness::Soundness) checks that each schedule is valid. A controllable
//! plan is dispatched along one of these schedules, whatever happens inside the box.

use std::fmt;

use elbowroom_num::{Interval, Rational};
use elbowroom_plan::uncertain::{Impossible, PlanNetwork};
use elbowroom_plan::{Bound, BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};
use elbowroom_stn::Weight;
use elbowroom_stn::uncertain::{
    Conflict, EarliestStrategy, Ground, LinkId, Recheck, StrongConflict, Unit,
};

/// Conflict that makes a network not dynamically controllable: no executor can satisfy it without
/// knowing values before they are observed.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlConflict {
    /// The grounds of the conflict, in order.
    pub grounds: Vec<ControlGround>,
}

/// A part of a [`ControlConflict`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ControlGround {
    /// A constraint of the plan, by position.
    Constraint(usize),
    /// The parameter may be as small as its interval allows.
    Early(ParameterId),
    /// The parameter may be as large as its interval allows.
    Late(ParameterId),
}

impl ControlConflict {
    /// Returns the ends of the box that are in the conflict, in order and without repetition.
    pub fn ends(&self) -> Vec<BoxEnd> {
        let end = |ground: &ControlGround| match *ground {
            ControlGround::Constraint(_) => None,
            ControlGround::Early(parameter) => Some(BoxEnd {
                parameter,
                side: Side::Lower,
            }),
            ControlGround::Late(parameter) => Some(BoxEnd {
                parameter,
                side: Side::Upper,
            }),
        };
        let mut ends: Vec<BoxEnd> = self.grounds.iter().filter_map(end).collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    }
}

impl fmt::Display for ControlConflict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an executor would have to know durations before it observes them")
    }
}

/// Check of dynamic controllability. It keeps the network of the last controllable box, and checks
/// a box that differs from it in one parameter incrementally.
#[derive(Clone, Debug, Default)]
pub(crate) struct DynamicControl {
    last_network: Option<CheckedNetwork>,
}

/// The network of a controllable box.
#[derive(Clone, Debug)]
struct CheckedNetwork {
    envelope: DecoupledEnvelope,
    network: PlanNetwork,
    /// A sufficient condition for the box. In most plans without waits, starting everything as
    /// early as possible suffices.
    earliest: Option<EarliestStrategy<Rational>>,
    /// The full check; made on the first use if there is an `earliest` strategy.
    full: Option<(Unit, Recheck<i64>)>,
    /// For each parameter, the link whose bounds are its interval; `None` if the parameter is also
    /// used elsewhere.
    links: Vec<Option<LinkId>>,
}

impl DynamicControl {
    /// Returns the reason why the plan is not dynamically controllable in the box; `None` if it is.
    pub(crate) fn conflict(
        &mut self,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
    ) -> Option<ControlConflict> {
        if let Some(kept) = &mut self.last_network {
            match kept.recheck(envelope) {
                Rechecked::Unknown => {}
                Rechecked::Controllable => return None,
                Rechecked::Refused(grounds) => {
                    return Some(translate_conflict(plan, &kept.network, &grounds));
                }
            }
        }
        let network = match plan.uncertain_network(envelope) {
            Ok(network) => network,
            Err(impossible) => return Some(unsatisfiable(impossible)),
        };
        let earliest = EarliestStrategy::new(&network.network);
        let mut full = None;
        if earliest.is_none() {
            let Some(whole) = network.network.to_integer_network() else {
                let conflict = network.network.conflict()?;
                return Some(translate_conflict(plan, &network, &grounds_of(&conflict)));
            };
            match Recheck::new(whole.network) {
                Ok(check) => full = Some((whole.unit, check)),
                Err(conflict) => {
                    return Some(translate_conflict(plan, &network, &grounds_of(&conflict)));
                }
            }
        }
        self.last_network = Some(CheckedNetwork {
            envelope: envelope.clone(),
            links: links_of(plan, &network),
            network,
            earliest,
            full,
        });
        None
    }

    /// Returns `true` if the kept network is that of this box.
    pub(crate) fn is_about(&self, envelope: &DecoupledEnvelope) -> bool {
        let kept = self.last_network.as_ref();
        kept.is_some_and(|kept| kept.envelope == *envelope)
    }

    /// Does the same as [`conflict`](Self::conflict) for a box that differs from the kept one in
    /// the interval of one parameter only, and keeps that one.
    pub(crate) fn conflict_if_moved(
        &mut self,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
        moved: ParameterId,
    ) -> Option<ControlConflict> {
        if let Some(kept) = &mut self.last_network {
            match kept.probe(moved, envelope.interval(moved)) {
                Rechecked::Controllable => return None,
                Rechecked::Refused(grounds) => {
                    return Some(translate_conflict(plan, &kept.network, &grounds));
                }
                Rechecked::Unknown => {}
            }
        }
        // The parameter is used elsewhere, or its bounds are large.
        Self::default().conflict(plan, envelope)
    }
}

impl CheckedNetwork {
    /// Checks a box that differs from the kept one in the interval of one link only. If it is
    /// controllable, it becomes the kept one.
    fn recheck(&mut self, envelope: &DecoupledEnvelope) -> Rechecked {
        let pairs = self.envelope.intervals().iter().zip(envelope.intervals());
        let mut moved = pairs.enumerate().filter(|(_, (old, new))| old != new);
        let Some((index, (_, interval))) = moved.next() else {
            return Rechecked::Controllable;
        };
        let link = self.links[index].filter(|_| moved.next().is_none());
        let Some(link) = link.filter(|&link| !self.is_early_enough(link, interval)) else {
            return Rechecked::Unknown;
        };
        let Some((unit, check)) = self.full_check() else {
            return Rechecked::Unknown;
        };
        let Some((lower, upper)) = bounds(unit, interval) else {
            return Rechecked::Unknown;
        };
        match check.change(link, lower, upper) {
            Ok(()) => {
                self.earliest = None;
                self.envelope.clone_from(envelope);
                Rechecked::Controllable
            }
            Err(conflict) => Rechecked::Refused(grounds_of(&conflict)),
        }
    }

    /// Checks a box that differs from the kept one in this interval only. The network stays as it
    /// is.
    fn probe(&mut self, moved: ParameterId, interval: &Interval) -> Rechecked {
        let Some(link) = self.links[moved.index()] else {
            return Rechecked::Unknown;
        };
        if self.is_early_enough(link, interval) {
            return Rechecked::Controllable;
        }
        let old = self.envelope.interval(moved).clone();
        let Some((unit, check)) = self.full_check() else {
            return Rechecked::Unknown;
        };
        let (Some((lower, upper)), Some((old_lower, old_upper))) =
            (bounds(unit, interval), bounds(unit, &old))
        else {
            return Rechecked::Unknown;
        };
        if let Err(conflict) = check.change(link, lower, upper) {
            return Rechecked::Refused(grounds_of(&conflict));
        }
        let restored = check.change(link, old_lower, old_upper);
        debug_assert!(restored.is_ok(), "the kept box is controllable");
        Rechecked::Controllable
    }

    /// Returns `true` if it is known that starting everything as early as possible suffices for
    /// this interval of a link.
    fn is_early_enough(&self, link: LinkId, interval: &Interval) -> bool {
        let (Some(strategy), Some(lower)) = (&self.earliest, interval.lower.value()) else {
            return false;
        };
        !lower.is_negative() && strategy.allows(link, lower, interval.upper.value())
    }

    /// Returns the check that decides about all bounds; `None` if numbers are too large for it.
    fn full_check(&mut self) -> Option<(Unit, &mut Recheck<i64>)> {
        if self.full.is_none() {
            let whole = self.network.network.to_integer_network()?;
            self.full = Some((whole.unit, Recheck::new(whole.network).ok()?));
        }
        let (unit, check) = self.full.as_mut()?;
        Some((*unit, check))
    }
}

/// Returns the bounds of a link in whole numbers, if they can be represented.
fn bounds(unit: Unit, interval: &Interval) -> Option<(i64, Option<i64>)> {
    let lower = unit.to_integer(interval.lower.value()?)?;
    let upper = match interval.upper.value() {
        Some(upper) => Some(unit.to_integer(upper)?),
        None => None,
    };
    let is_in_order = lower >= 0 && upper.is_none_or(|upper| lower <= upper);
    is_in_order.then_some((lower, upper))
}

/// The result of an incremental controllability check.
enum Rechecked {
    /// Unknown: the box differs in more than one link.
    Unknown,
    Controllable,
    Refused(Vec<Ground>),
}

/// Returns, for each parameter, the link whose bounds are its interval, provided that the parameter
/// is not used elsewhere.
fn links_of(plan: &ParametrizedPlan, network: &PlanNetwork) -> Vec<Option<LinkId>> {
    let mut uses = vec![0; plan.parameters.len()];
    for constraint in &plan.plan.constraints {
        let both = [&constraint.lower, &constraint.upper].map(Bound::parameter);
        let (first, second) = (both[0], both[1].filter(|_| both[0] != both[1]));
        for id in first.into_iter().chain(second) {
            uses[id.index()] += 1;
        }
    }
    let mut links = vec![None; plan.parameters.len()];
    for (link, &source) in network.network.link_ids().zip(&network.links) {
        if let Some(id) = plan.plan.constraints[source].lower.parameter()
            && uses[id.index()] == 1
        {
            links[id.index()] = Some(link);
        }
    }
    links
}

/// Returns the reason why no fixed schedule works for all values.
pub(crate) fn strong_conflict(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<ControlConflict> {
    let network = match plan.uncertain_network(envelope) {
        Ok(network) => network,
        Err(impossible) => return Some(unsatisfiable(impossible)),
    };
    let StrongConflict { grounds, .. } = network.network.strong().err()?;
    Some(translate_conflict(plan, &network, &grounds))
}

/// Returns a number that is greater than the sum of the finite bounds on any cycle of the network
/// for fixed times. `None` if nothing satisfies the network.
pub(crate) fn beyond_all_bounds(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<Rational> {
    let PlanNetwork { network, .. } = plan.uncertain_network(envelope).ok()?;
    let links = network.link_ids().map(|id| {
        let link = network.link(id);
        let upper = link.upper.as_ref().map(Rational::abs);
        link.lower.abs() + upper.unwrap_or_default()
    });
    let links: Rational = links.fold(Rational::ZERO, |sum, own| sum + own);
    // Each requirement occurs on a simple cycle at most once, and each link at most once with it.
    let bounds = network.requirements().constraints().iter();
    let all = bounds.fold(Rational::ONE, |sum, own| {
        sum + own.bound.abs() + links.clone()
    });
    Some(all)
}

fn unsatisfiable(Impossible(index): Impossible) -> ControlConflict {
    ControlConflict {
        grounds: vec![ControlGround::Constraint(index)],
    }
}

fn grounds_of<W: Weight>(conflict: &Conflict<W>) -> Vec<Ground> {
    conflict.steps.iter().map(|step| step.ground).collect()
}

fn translate_conflict(
    plan: &ParametrizedPlan,
    network: &PlanNetwork,
    grounds: &[Ground],
) -> ControlConflict {
    let parameter = |index: usize| plan.plan.constraints[index].lower.parameter();
    let ground = |ground: &Ground| match *ground {
        Ground::Requirement(id) => network.constraint_of(id).map(ControlGround::Constraint),
        Ground::Early(link) => parameter(network.links[link.index()]).map(ControlGround::Early),
        Ground::Late(link) => parameter(network.links[link.index()]).map(ControlGround::Late),
    };
    ControlConflict {
        grounds: grounds.iter().filter_map(ground).collect(),
    }
}
