//! Derivation of a [`Cut`] from a box without a schedule, or without a strategy.
//!
//! A conflict is a cycle of bounds whose length depends linearly on the ends of the box. Every box
//! with a negative length of this cycle is rejected for the same reason. So all boxes inside the
//! envelope satisfy "the length is not negative". A semi-reducible cycle has further conditions:
//! the part after a duration at its lower end must be negative, and a wait is at least as long as
//! the minimum duration. So it gives a disjunction: the cycle is not negative, or one of these
//! parts is not negative.

mod short_cycles;

use std::collections::BTreeSet;

use elbowroom_num::Rational;
use elbowroom_plan::uncertain::PlanNetwork;
use elbowroom_plan::{
    Bound, BoxEnd, Constraint, DecoupledEnvelope, Origin, ParameterId, ParametrizedPlan, Side,
    Valuation, network_node,
};
use elbowroom_stn::ConstraintId;
use elbowroom_stn::uncertain::{
    EarliestStrategy, Ground as StepGround, LinkId, Part, Refutation, RefutationPath, Refuted,
    StrongConflict,
};

use crate::cut::{Cut, EndSum, Ground, Length, ProofPart, ProofPath};
use short_cycles::Shortcuts;

/// The limit on the rows of a cut.
const MAX_ROWS: usize = 64;

/// Result of a check, in terms of cuts.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum CheckOutcome {
    /// The box is accepted.
    Accepted,
    /// The box is rejected, with at least one cut.
    Cuts(Vec<Cut>),
    /// The box is rejected, but there is no linear cut.
    Unknown,
}

/// Returns the cut that follows from values without a schedule.
pub(crate) fn schedule_cut(
    plan: &ParametrizedPlan,
    values: &Valuation,
    envelope: &DecoupledEnvelope,
) -> CheckOutcome {
    let (network, origins) = plan.plan.network_with_origins(values);
    let Err(cycle) = network.consistency() else {
        return CheckOutcome::Unknown;
    };
    let cycle: Vec<Origin> = cycle
        .constraints
        .iter()
        .map(|id| origins[id.index()])
        .collect();
    // The sum of each parameter's coefficients; its sign determines the worse end.
    let mut constant = Rational::ZERO;
    let mut counts = vec![Rational::ZERO; plan.parameters.len()];
    for origin in &cycle {
        let (bound, sign) = match *origin {
            Origin::Beginning => continue,
            Origin::AtLeast(index) => (&plan.plan.constraints[index].lower, -1),
            Origin::AtMost(index) => (&plan.plan.constraints[index].upper, 1),
        };
        let sign = Rational::from(sign);
        match bound {
            Bound::Infinite => return CheckOutcome::Unknown,
            Bound::Finite(value) => constant += value * &sign,
            Bound::Parameter(id) => counts[id.index()] += &sign,
        }
    }
    let mut ends = EndSum::constant(constant);
    for (index, count) in counts.iter().enumerate() {
        if !count.is_zero() {
            let side = if count.is_positive() {
                Side::Lower
            } else {
                Side::Upper
            };
            let parameter = ParameterId::from(index);
            ends.add_end(BoxEnd { parameter, side }, count);
        }
    }
    outcome_from(vec![ends], Ground::Cycle(cycle), envelope)
}

/// Returns the conflicts that prevent dynamic controllability in the box: at most `most`, found in
/// one pass over its network.
pub(crate) fn strategy_cuts(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
    most: usize,
) -> CheckOutcome {
    let Ok(network) = plan.uncertain_network(envelope) else {
        return CheckOutcome::Unknown;
    };
    if EarliestStrategy::new(&network.network).is_some() {
        return CheckOutcome::Accepted;
    }
    let refuted = match network.network.to_integer_network() {
        Some(whole) => whole.network.refutations(most),
        None => network.network.refutations(most),
    };
    let refutations = match refuted {
        Refuted::No => return CheckOutcome::Accepted,
        Refuted::TooLong => return CheckOutcome::Unknown,
        Refuted::Refutations(refutations) => refutations,
    };
    let reader = Reader {
        plan,
        network: &network,
    };
    let shortcuts = Shortcuts::new(&reader);
    let mut known = BTreeSet::new();
    let mut cuts = Vec::new();
    for refutation in &refutations {
        let mut found = shortcuts.short_cycle_cuts(&reader, refutation, envelope);
        if found.is_empty() {
            found.extend(reader.cut(refutation, envelope));
        }
        found.retain(|cut| {
            let ends = cut.rows.iter().map(|row| row.factors.keys());
            known.insert(ends.map(Vec::from_iter).collect::<Vec<_>>())
        });
        cuts.append(&mut found);
    }
    cuts.truncate(most);
    if cuts.is_empty() {
        CheckOutcome::Unknown
    } else {
        CheckOutcome::Cuts(cuts)
    }
}

/// Returns the conflict that prevents strong controllability in the box.
pub(crate) fn fixed_time_cuts(
    plan: &ParametrizedPlan,
    envelope: &DecoupledEnvelope,
) -> CheckOutcome {
    let Ok(network) = plan.uncertain_network(envelope) else {
        return CheckOutcome::Unknown;
    };
    let Err(StrongConflict { grounds, total }) = network.network.strong() else {
        return CheckOutcome::Accepted;
    };
    if total.is_none() {
        // An end is infinite, whatever the others are, so there is no sum.
        return CheckOutcome::Unknown;
    }
    let reader = Reader {
        plan,
        network: &network,
    };
    let mut total = EndSum::default();
    let mut parts = Vec::new();
    for ground in grounds {
        let (length, part) = match ground {
            StepGround::Requirement(id) => {
                let Some((length, origin)) = reader.requirement(id) else {
                    return CheckOutcome::Unknown;
                };
                (length, ProofPart::Bound(origin))
            }
            StepGround::Early(link) => (
                reader.link(link, Side::Lower),
                ProofPart::Early(network.links[link.index()]),
            ),
            StepGround::Late(link) => (
                reader.link(link, Side::Upper),
                ProofPart::Late(network.links[link.index()]),
            ),
        };
        total.add_length(&length);
        parts.push(part);
    }
    outcome_from(vec![total], Ground::Fixed(parts), envelope)
}

fn outcome_from(
    alternatives: Vec<EndSum>,
    ground: Ground,
    envelope: &DecoupledEnvelope,
) -> CheckOutcome {
    match cut(alternatives, ground, envelope) {
        Some(cut) => CheckOutcome::Cuts(vec![cut]),
        None => CheckOutcome::Unknown,
    }
}

/// Returns the cut that one of these is not negative; `None` unless all are negative in the box.
fn cut(alternatives: Vec<EndSum>, ground: Ground, envelope: &DecoupledEnvelope) -> Option<Cut> {
    let mut rows = Vec::new();
    for ends in alternatives {
        let row = ends.not_negative();
        if !rows.contains(&row) {
            rows.push(row);
        }
    }
    let cut = Cut { rows, ground };
    (!cut.holds_in(envelope)).then_some(cut)
}

/// Returns all sums of one element of each list.
fn sums(mut some: Vec<EndSum>, others: &[EndSum]) -> Vec<EndSum> {
    if let [other] = others {
        // The usual case, and a path may have thousands of parts.
        for one in &mut some {
            one.add(other);
        }
        return some;
    }
    let sums = some
        .iter()
        .flat_map(|one| others.iter().map(move |other| one.plus(other)));
    sums.collect()
}

/// Returns the cut of a cycle of such steps, provided that it uses one end of each parameter and
/// excludes every schedule.
fn whole_cycle_cut<'a>(
    reader: &Reader<'_>,
    parts: impl Iterator<Item = &'a Part>,
    envelope: &DecoupledEnvelope,
) -> Option<Cut> {
    let mut total = EndSum::default();
    let mut origins = Vec::new();
    for part in parts {
        let (length, origin) = reader.step_length(part)?;
        total.add_length(&length);
        origins.push(origin);
    }
    if total.uses_both_ends() {
        return None;
    }
    cut(vec![total], Ground::Cycle(origins), envelope)
}

/// Returns the steps of a cycle in order, without the structure of paths, which are nested as
/// deeply as a plan is long.
fn steps(cycle: &[RefutationPath]) -> impl Iterator<Item = &Part> {
    let mut open: Vec<&Part> = cycle.iter().flat_map(|way| &way.parts).rev().collect();
    std::iter::from_fn(move || {
        loop {
            match open.pop()? {
                Part::Path(way) => open.extend(way.parts.iter().rev()),
                step => return Some(step),
            }
        }
    })
}

/// Reads the bounds of a network in terms of the ends of a box.
struct Reader<'a> {
    plan: &'a ParametrizedPlan,
    network: &'a PlanNetwork,
}

impl Reader<'_> {
    /// Returns the cut that follows from a conflict in the box.
    fn cut(&self, refutation: &Refutation, envelope: &DecoupledEnvelope) -> Option<Cut> {
        let whole = whole_cycle_cut(self, steps(&refutation.cycle), envelope);
        if whole.is_some() || refutation.is_flat {
            return whole;
        }
        let mut rows = Vec::new();
        let mut total = vec![EndSum::default()];
        for way in &refutation.cycle {
            total = sums(total, &self.lengths(way, &mut rows)?);
            if total.len() + rows.len() > MAX_ROWS {
                return None;
            }
        }
        rows.extend(total);
        let ways = refutation.cycle.iter().map(|way| self.proof_path(way));
        let ground = Ground::Semireducible(ways.collect::<Option<Vec<ProofPath>>>()?);
        cut(rows, ground, envelope)
    }

    /// Returns the length of a step, and the bound that it represents; `None` for a path.
    fn step_length(&self, part: &Part) -> Option<(Length, Origin)> {
        let constraint = |link: &LinkId| self.network.links[link.index()];
        Some(match part {
            Part::Requirement(id) => self.requirement(*id)?,
            Part::Early(link) => {
                let length = self.link(*link, Side::Lower);
                (length, Origin::AtMost(constraint(link)))
            }
            Part::Late(link) => {
                let length = self.link(*link, Side::Upper);
                (length, Origin::AtLeast(constraint(link)))
            }
            Part::Path(_) => return None,
        })
    }

    /// Returns the constraint that leaves a link's duration open.
    fn constraint(&self, link: LinkId) -> &Constraint {
        &self.plan.plan.constraints[self.network.links[link.index()]]
    }

    /// Returns the lower bound of a link, or minus its upper one.
    fn link(&self, link: LinkId, side: Side) -> Length {
        let constraint = self.constraint(link);
        let (bound, sign) = match side {
            Side::Lower => (&constraint.lower, 1),
            Side::Upper => (&constraint.upper, -1),
        };
        let sign = Rational::from(sign);
        match bound {
            Bound::Parameter(parameter) => {
                let parameter = *parameter;
                Length::End(BoxEnd { parameter, side }, sign)
            }
            Bound::Finite(value) => Length::Fixed(value * &sign),
            Bound::Infinite => Length::Fixed(Rational::ZERO),
        }
    }

    /// Returns the bound of a requirement, and its origin.
    fn requirement(&self, id: ConstraintId) -> Option<(Length, Origin)> {
        let requirement = self.network.network.requirements().constraint(id);
        let fixed = Length::Fixed(requirement.bound.clone());
        let Some(index) = self.network.constraint_of(id) else {
            return Some((fixed, Origin::Beginning));
        };
        let constraint = &self.plan.plan.constraints[index];
        if constraint.from == constraint.to {
            return None;
        }
        let is_upper = requirement.from == network_node(constraint.from);
        let (own, origin) = if is_upper {
            (&constraint.upper, Origin::AtMost(index))
        } else {
            (&constraint.lower, Origin::AtLeast(index))
        };
        let is_told = self.plan.commanded_duration(constraint).is_some();
        let (Bound::Parameter(parameter), false) = (own, is_told) else {
            return Some((fixed, origin));
        };
        if constraint.lower == constraint.upper && self.plan.plan.is_controlled_by_world(constraint)
        {
            // A second duration that ends at the same node.
            return None;
        }
        // The bound has to hold for all values, so an upper bound applies at the parameter's lower
        // end.
        let (side, sign) = if is_upper {
            (Side::Lower, 1)
        } else {
            (Side::Upper, -1)
        };
        let parameter = *parameter;
        let end = BoxEnd { parameter, side };
        Some((Length::End(end, Rational::from(sign)), origin))
    }

    /// Returns the possible lengths of a path; the greatest of them applies. Adds to `legal` the
    /// lengths that have to be negative for the path to exist.
    fn lengths(&self, way: &RefutationPath, legal: &mut Vec<EndSum>) -> Option<Vec<EndSum>> {
        let mut lengths = vec![EndSum::default()];
        for part in way.parts.iter().rev() {
            let own = match part {
                Part::Requirement(id) => vec![self.requirement(*id)?.0.into()],
                Part::Early(link) => {
                    legal.extend(lengths.iter().cloned());
                    vec![self.link(*link, Side::Lower).into()]
                }
                Part::Late(link) => vec![self.link(*link, Side::Upper).into()],
                Part::Path(way) => self.lengths(way, legal)?,
            };
            lengths = sums(lengths, &own);
            if lengths.len() + legal.len() > MAX_ROWS {
                return None;
            }
        }
        if let Some(link) = way.unlabelled {
            let least: EndSum = self.link(link, Side::Lower).into();
            lengths.push(least.negated());
        }
        Some(lengths)
    }

    /// Converts a path to the terms of the plan.
    fn proof_path(&self, way: &RefutationPath) -> Option<ProofPath> {
        let constraint = |link: LinkId| self.network.links[link.index()];
        let parts = way.parts.iter().map(|part| {
            Some(match part {
                Part::Requirement(id) => ProofPart::Bound(self.requirement(*id)?.1),
                Part::Early(link) => ProofPart::Early(constraint(*link)),
                Part::Late(link) => ProofPart::Late(constraint(*link)),
                Part::Path(way) => ProofPart::Path(self.proof_path(way)?),
            })
        });
        Some(ProofPath {
            parts: parts.collect::<Option<_>>()?,
            unlabelled: way.unlabelled.map(constraint),
        })
    }
}
