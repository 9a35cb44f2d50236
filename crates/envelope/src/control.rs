//! Dynamic and strong controllability of a plan in a box.
//!
//! The plan's network with contingent links for what the world decides on
//! ([`ParametrizedPlan::uncertain_network`]), asked by `elbowroom-stn`. That each schedule is valid
//! is the business of [`Soundness`](crate::soundness::Soundness), as with every guarantee; a plan
//! that is controllable too is dispatched along one of them, whatever happens inside the box.

use std::fmt;

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::{Impossible, PlanNetwork};
use elbowroom_plan::{Bound, BoxEnd, DecoupledEnvelope, ParameterId, ParametrizedPlan, Side};
use elbowroom_stn::uncertain::{
    Conflict, ContingentLink, Ground, StrongConflict, UncertainNetwork,
};
use elbowroom_stn::{Constraint, Network, Weight};

/// What no executor can satisfy without knowing beforehand what it learns too late.
#[derive(Clone, Debug, PartialEq)]
pub struct ControlConflict {
    /// What stands against each other, in order.
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
    /// The ends of the box that are taken into account, in order and without repetition.
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
        f.write_str("an executor would have to know in advance what it learns too late")
    }
}

/// Why the plan cannot be executed by one who learns each value only as it comes about.
pub(crate) fn dynamic_conflict(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<ControlConflict> {
    let network = match plan.uncertain_network(envelope) {
        Ok(network) => network,
        Err(impossible) => return Some(unsatisfiable(impossible)),
    };
    // Whole numbers are several times faster.
    let conflict = match whole(&network.network) {
        Some(whole) => whole.conflict().map(|conflict| grounds_of(&conflict)),
        None => network
            .network
            .conflict()
            .map(|conflict| grounds_of(&conflict)),
    };
    conflict.map(|grounds| in_the_plan(plan, &network, &grounds))
}

/// Why no times fixed beforehand do for all values.
pub(crate) fn strong_conflict(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> Option<ControlConflict> {
    let network = match plan.uncertain_network(envelope) {
        Ok(network) => network,
        Err(impossible) => return Some(unsatisfiable(impossible)),
    };
    let StrongConflict { grounds, .. } = network.network.strong().err()?;
    Some(in_the_plan(plan, &network, &grounds))
}

fn unsatisfiable(Impossible(index): Impossible) -> ControlConflict {
    ControlConflict {
        grounds: vec![ControlGround::Constraint(index)],
    }
}

fn grounds_of<W: Weight>(conflict: &Conflict<W>) -> Vec<Ground> {
    conflict.steps.iter().map(|step| step.ground).collect()
}

fn in_the_plan(
    plan: &ParametrizedPlan,
    network: &PlanNetwork,
    grounds: &[Ground],
) -> ControlConflict {
    let parameter = |index: usize| match plan.plan.constraints[index].lower {
        Bound::Parameter(id) => Some(id),
        Bound::Finite(_) | Bound::Infinite => None,
    };
    let ground = |ground: &Ground| match *ground {
        Ground::Requirement(id) => network.constraint_of(id).map(ControlGround::Constraint),
        Ground::Early(link) => parameter(network.links[link.index()]).map(ControlGround::Early),
        Ground::Late(link) => parameter(network.links[link.index()]).map(ControlGround::Late),
    };
    ControlConflict {
        grounds: grounds.iter().filter_map(ground).collect(),
    }
}

/// The network with all bounds multiplied by their common denominator, if that gives numbers of
/// which none that the check computes overflows.
fn whole(network: &UncertainNetwork) -> Option<UncertainNetwork<i64>> {
    /// Distances stay within the largest bound, sums of two far below overflow.
    const LARGEST: i128 = 1 << 50;
    let requirements = network.requirements().constraints().iter();
    let bounds = requirements.clone().map(|constraint| &constraint.bound);
    let links = network.links().iter();
    let bounds = bounds.chain(links.clone().map(|link| &link.lower));
    let bounds = bounds.chain(links.clone().filter_map(|link| link.upper.as_ref()));
    let mut denominator: i128 = 1;
    for bound in bounds {
        let own = i128::from(bound.denominator()?);
        if denominator % own != 0 {
            denominator = denominator.checked_mul(own / gcd(denominator, own))?;
        }
        if denominator > LARGEST {
            return None;
        }
    }
    let scaled = |value: &Rational| {
        let (numerator, own) = value.as_small()?;
        let value = i128::from(numerator).checked_mul(denominator / i128::from(own))?;
        (value.abs() <= LARGEST).then(|| i64::try_from(value).ok())?
    };
    let mut whole = Network::with_nodes(network.requirements().node_count());
    for constraint in requirements {
        whole.add(Constraint {
            from: constraint.from,
            to: constraint.to,
            bound: scaled(&constraint.bound)?,
        });
    }
    let mut whole_links = Vec::with_capacity(network.links().len());
    for link in links {
        let upper = match &link.upper {
            Some(upper) => Some(scaled(upper)?),
            None => None,
        };
        whole_links.push(ContingentLink {
            activation: link.activation,
            end: link.end,
            lower: scaled(&link.lower)?,
            upper,
        });
    }
    UncertainNetwork::new(whole, whole_links).ok()
}

fn gcd(a: i128, b: i128) -> i128 {
    if b == 0 { a } else { gcd(b, a % b) }
}
