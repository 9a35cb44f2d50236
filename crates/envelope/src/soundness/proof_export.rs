//! Proofs that no condition can fail in a box, constraint by constraint.

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_num::Rational;
use elbowroom_plan::{Bound, DecoupledEnvelope, NodeId, Origin, ParameterId, ParametrizedPlan};

use super::Soundness;
use super::certificate::{Certificate, Term};
use super::lazy_network::AnySchedules;
use super::proof::Proof;
use super::violation_case::Outcome;
use crate::obligations::{Difference, Inequality, OverAll, Requirement};
use crate::proof::{ConditionProof, ImpossibilityProof, Refutation, RefutedCase, Summand};
use crate::reduction::Reduction;

impl Soundness {
    /// Returns the proofs for a box without violations; `None` if the box has no schedule.
    pub(crate) fn export_proofs(
        &self,
        task: &Task,
        plan: &ParametrizedPlan,
        envelope: &DecoupledEnvelope,
    ) -> Option<Vec<ConditionProof>> {
        let numbers = self.numbers.as_ref();
        let mut schedules = AnySchedules::with_explanations(&self.reduction, envelope, numbers)?;
        let teller = ProofExporter {
            task,
            plan,
            reduction: &self.reduction,
            rigid: Rigid::new(plan),
            envelope,
            is_in_ranges: DecoupledEnvelope::ranges(plan).includes(envelope),
        };
        let mut told = Vec::new();
        for obligation in &self.obligations.direct {
            let ways = obligation.bad_cases.iter().map(|case| {
                let Outcome::Impossible(proofs) = schedules.possible(case) else {
                    return None;
                };
                let (differences, inequalities) = (&case.differences, &case.inequalities);
                Some(teller.impossible(differences, &[], inequalities, &proofs))
            });
            let ways: Option<Vec<RefutedCase>> = ways.collect();
            told.push(ConditionProof {
                requirement: obligation.requirement.clone(),
                during: None,
                proof: ways.map(ImpossibilityProof::Cases),
            });
        }
        for over_all in &self.obligations.over_all {
            let attempt = schedules.prove(task, plan, over_all, teller.is_in_ranges, (None, None));
            let why = match attempt {
                Ok(Ok(proof)) => teller.over_all(over_all, &proof),
                Ok(Err(_)) | Err(_) => None,
            };
            told.push(ConditionProof {
                requirement: Requirement::OverAll {
                    instance: over_all.instance,
                    condition: over_all.condition.clone(),
                },
                during: Some([over_all.start, over_all.end]),
                proof: why,
            });
        }
        Some(told)
    }
}

struct ProofExporter<'a> {
    task: &'a Task,
    plan: &'a ParametrizedPlan,
    reduction: &'a Reduction,
    rigid: Rigid,
    envelope: &'a DecoupledEnvelope,
    is_in_ranges: bool,
}

impl ProofExporter<'_> {
    /// Converts the proofs that a way of failing is impossible. The proofs number the differences:
    /// first those of `known`, then those of `own`.
    fn impossible(
        &self,
        own: &[Difference],
        known: &[Difference],
        inequalities: &[Inequality],
        proofs: &[Certificate],
    ) -> RefutedCase {
        let fixed = proofs.iter().flat_map(|proof| &proof.fixed);
        let mut corners: Vec<ParameterId> = fixed.map(|end| end.parameter).collect();
        corners.sort_unstable();
        corners.dedup();
        let differences: Vec<&Difference> = known.iter().chain(own).collect();
        let places = self.corner_values(&corners);
        let sums = places.into_iter().filter_map(|(place, values)| {
            let proof = proofs.get(place)?;
            Some(self.refutation(proof, &differences, inequalities, &values))
        });
        RefutedCase {
            differences: own.to_vec(),
            inequalities: inequalities.to_vec(),
            corners,
            sums: sums.collect(),
        }
    }

    /// Returns, for each combination of ends of multiplied parameters, the position of its proof
    /// and the values there. The last parameter's ends vary slowest. Equal ends share a proof.
    /// Returns none if an end is infinite.
    fn corner_values(
        &self,
        corners: &[ParameterId],
    ) -> Vec<(usize, BTreeMap<ParameterId, Rational>)> {
        let mut places = vec![(0, BTreeMap::new())];
        for &parameter in corners {
            let interval = self.envelope.interval(parameter);
            let (Some(lower), Some(upper)) = (interval.lower.value(), interval.upper.value())
            else {
                return Vec::new();
            };
            let ends = if lower == upper { 1 } else { 2 };
            let each = places.iter().flat_map(|(place, values)| {
                [lower, upper]
                    .into_iter()
                    .enumerate()
                    .map(move |(side, value)| {
                        let mut values = values.clone();
                        values.insert(parameter, value.clone());
                        (place * ends + side.min(ends - 1), values)
                    })
            });
            places = each.collect();
        }
        places
    }

    /// Returns the sum in terms of the plan's own constraints, for some values of multiplied
    /// parameters.
    fn refutation(
        &self,
        proof: &Certificate,
        differences: &[&Difference],
        inequalities: &[Inequality],
        values: &BTreeMap<ParameterId, Rational>,
    ) -> Refutation {
        let mut sum: BTreeMap<Summand, Rational> = BTreeMap::new();
        let mut left: BTreeMap<NodeId, Rational> = BTreeMap::new();
        let mut walk = |from: NodeId, to: NodeId, factor: &Rational| {
            *left.entry(to).or_default() += factor;
            *left.entry(from).or_default() -= factor;
        };
        for (term, factor) in &proof.terms {
            let summand = match *term {
                Term::Edge(index) => {
                    let edge = &self.reduction.edges()[index];
                    match edge.origin {
                        Origin::Beginning => {
                            walk(edge.node, NodeId::ZERO, factor);
                            Summand::NonNegativeTime(edge.node)
                        }
                        Origin::AtLeast(index) => {
                            let own = &self.plan.plan.constraints[index];
                            walk(own.to, own.from, factor);
                            Summand::AtLeast(index)
                        }
                        Origin::AtMost(index) => {
                            let own = &self.plan.plan.constraints[index];
                            walk(own.from, own.to, factor);
                            Summand::AtMost(index)
                        }
                    }
                }
                Term::Assumed(index) => {
                    let own = differences[index];
                    walk(own.from, own.to, factor);
                    Summand::Difference(index)
                }
                Term::Inequality(index) => {
                    let fixed = inequalities[index].expression.with_values(values);
                    for (node, own) in &fixed.times {
                        walk(NodeId::ZERO, *node, &(own * factor));
                    }
                    Summand::Inequality(index)
                }
            };
            *sum.entry(summand).or_default() += factor;
        }
        self.rigid.settle(&mut left, &mut sum);
        sum.into_iter()
            .filter(|(_, factor)| !factor.is_zero())
            .collect()
    }

    /// Converts the proof that an over-all condition cannot fail.
    fn over_all(&self, over_all: &OverAll, proof: &Proof) -> Option<ImpossibilityProof> {
        let events = over_all.events(self.is_in_ranges);
        let mut place = MomentPlacement {
            known: vec![
                Difference::before(over_all.start, over_all.moment),
                Difference::before(over_all.moment, over_all.end),
            ],
            happened: Vec::new(),
        };
        self.place((over_all, &events), 0, &mut place, proof)
    }

    fn place(
        &self,
        (over_all, events): (&OverAll, &[NodeId]),
        index: usize,
        place: &mut MomentPlacement,
        proof: &Proof,
    ) -> Option<ImpossibilityProof> {
        match proof {
            Proof::NoMoment(certificate) => {
                let differences: Vec<&Difference> = place.known.iter().collect();
                let nothing = BTreeMap::new();
                let sum = self.refutation(certificate, &differences, &[], &nothing);
                Some(ImpossibilityProof::NoMoment(sum))
            }
            Proof::Either(after, before) => {
                let event = *events.get(index)?;
                let moment = over_all.moment;
                place.happened.push(event);
                place.known.push(Difference::not_after(event, moment));
                let after = self.place((over_all, events), index + 1, place, after)?;
                place.happened.pop();
                place.known.pop();
                place.known.push(Difference::before(moment, event));
                let before = self.place((over_all, events), index + 1, place, before)?;
                place.known.pop();
                Some(ImpossibilityProof::Split(
                    event,
                    Box::new(after),
                    Box::new(before),
                ))
            }
            Proof::True(cases) => {
                let cut = |node: NodeId| place.happened.contains(&node);
                let all = over_all.cases(self.task, &self.plan.plan, self.is_in_ranges, &cut);
                let all = all.ok()?;
                if all.len() != cases.len() {
                    return None;
                }
                let ways = all
                    .into_iter()
                    .zip(cases)
                    .map(|(mut inequalities, proofs)| {
                        inequalities.extend(over_all.assumptions.iter().cloned());
                        self.impossible(&[], &place.known, &inequalities, proofs)
                    });
                Some(ImpossibilityProof::Cases(ways.collect()))
            }
        }
    }
}

/// Place of the moment of an over-all condition.
struct MomentPlacement {
    known: Vec<Difference>,
    happened: Vec<NodeId>,
}

/// Spanning trees of the constraints that fix differences. They express the times of rigidly
/// connected nodes by each other.
struct Rigid {
    /// Nodes, each after the node that its time is computed from; with that node, the constraint
    /// between the two, and `true` if the constraint leads to the first.
    computed_from: Vec<(NodeId, NodeId, usize, bool)>,
}

impl Rigid {
    fn new(plan: &ParametrizedPlan) -> Self {
        let mut neighbours = vec![Vec::new(); plan.plan.nodes.len()];
        for (index, own) in plan.plan.constraints.iter().enumerate() {
            if let (Bound::Finite(lower), Bound::Finite(upper)) = (&own.lower, &own.upper)
                && lower == upper
            {
                neighbours[own.from.index()].push((own.to, index, true));
                neighbours[own.to.index()].push((own.from, index, false));
            }
        }
        let mut is_known = vec![false; neighbours.len()];
        let mut reckoned = Vec::new();
        for root in 0..neighbours.len() {
            if std::mem::replace(&mut is_known[root], true) {
                continue;
            }
            let mut open = vec![NodeId::from(root)];
            while let Some(node) = open.pop() {
                for &(next, index, is_to) in &neighbours[node.index()] {
                    if !std::mem::replace(&mut is_known[next.index()], true) {
                        reckoned.push((next, node, index, is_to));
                        open.push(next);
                    }
                }
            }
        }
        Self {
            computed_from: reckoned,
        }
    }

    /// Adds the constraints that cancel the times left in a sum.
    fn settle(&self, left: &mut BTreeMap<NodeId, Rational>, sum: &mut BTreeMap<Summand, Rational>) {
        for &(node, by, index, is_to) in self.computed_from.iter().rev() {
            let Some(factor) = left.remove(&node).filter(|factor| !factor.is_zero()) else {
                continue;
            };
            // The bound with the opposite sign of the time.
            let summand = if factor.is_positive() == is_to {
                Summand::AtLeast(index)
            } else {
                Summand::AtMost(index)
            };
            *sum.entry(summand).or_default() += &factor.abs();
            *left.entry(by).or_default() += &factor;
        }
    }
}
