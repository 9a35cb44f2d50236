//! The proof that a box is inside the envelope and no other box there is larger, in the form that
//! `elbowroom-verify` checks.

mod containment;
mod network;

use std::collections::BTreeMap;

use elbowroom_envelope::{
    BestProof, BestSettings, BoxVariable, Cut, Ground, Guarantee, Objective, Oracle,
};
use elbowroom_envelope::{
    BoundSource as KnownSource, OptimalityProof as KnownReasons, ProofCase as KnownCase,
};
use elbowroom_envelope::{ProofPart, ProofPath, volume_foot};
use elbowroom_num::Rational;
use elbowroom_plan::{BoxEnd, DecoupledEnvelope, Origin, ParametrizedPlan, Side};
use elbowroom_verify::{
    Case, Certificate, Constraint, End, Exact, Multiplier, Parameter, Part, Path, Proof, Reasons,
    Source, Stopped, Sum, Term, Total, with_sums,
};

use super::Subject;
use network::{constraints, used_constraints};

/// Returns the certificate that a box is the best one. It contains the cuts that the proof uses. It
/// contains all constraints of the plan if it also proves that the box is inside the envelope;
/// otherwise only those that are used.
pub(super) fn certificate(
    subject: &Subject<'_>,
    settings: &BestSettings,
    proof: &BestProof,
    (oracle, envelope): (&mut Oracle, &DecoupledEnvelope),
) -> Option<Certificate> {
    let plan = subject.plan;
    let guarantee = subject.request.guarantee;
    let mut cuts = Cuts::default();
    let reasons = reasons(settings, proof, &mut cuts);
    let proofs = cuts.used.iter();
    let mut proofs: Vec<Proof> = proofs
        .map(|&cut| proof_of(subject, &proof.cuts[cut]))
        .collect();
    let constraints = constraints(plan, guarantee);
    for proof in &mut proofs {
        fill_start_points(proof, &constraints);
    }
    let sound = containment::containment_proof(subject, oracle, envelope);
    let constraints = match sound {
        Some(_) => constraints,
        None => used_constraints(constraints, &mut proofs),
    };
    let is_used = used_limits(&reasons, proof.variables.len());
    let limit = |side: Side, parameter: usize| {
        let moves = |end: &BoxEnd| end.parameter.index() == parameter && end.side == side;
        let variable = proof
            .variables
            .iter()
            .position(|own| own.ends.iter().any(moves))?;
        let own = &proof.variables[variable];
        let is_limit =
            greatest_gain(plan, settings, own).is_none_or(|gains| own.max_distance < gains);
        (is_used[variable] && is_limit).then(|| Exact(own.max_distance.clone()))
    };
    let scale = |parameter: usize| {
        let moves = |end: &BoxEnd| end.parameter.index() == parameter;
        let own = proof
            .variables
            .iter()
            .find(|own| own.ends.iter().any(moves))?;
        Some(own.scale.clone())
    };
    let parameters = plan.parameters.iter().enumerate().map(|(index, own)| {
        Some(Parameter {
            name: own.name.clone(),
            nominal: own.nominal.clone(),
            scale: scale(index)?,
            weight: own.weight.clone(),
            most_below: limit(Side::Lower, index),
            most_above: limit(Side::Upper, index),
            chance: settings
                .distributions
                .get(index)
                .and_then(|own| own.as_ref().map(Into::into)),
        })
    });
    let certificate = Certificate {
        // Filled in later, with the sums.
        proves: String::new(),
        assumes: Vec::new(),
        guarantee: match guarantee {
            Guarantee::Weak => elbowroom_verify::Guarantee::Weak,
            Guarantee::Dynamic => elbowroom_verify::Guarantee::Dynamic,
            Guarantee::Strong => elbowroom_verify::Guarantee::Strong,
            // The checker does not know this guarantee.
            _ => return None,
        },
        parameters: parameters.collect::<Option<_>>()?,
        points: plan
            .plan
            .nodes()
            .map(|(node, _)| plan.plan.node_label(node))
            .collect(),
        constraints,
        symmetric: settings.symmetric,
        counted: settings.max_deviation.clone(),
        slacks: proof
            .variables
            .iter()
            .map(|own| Exact(own.value.clone()))
            .collect(),
        proofs,
        reasons,
        sound,
    };
    with_sums(certificate).ok()
}

/// Returns the derivation, from the cuts, that no box is better.
fn reasons(settings: &BestSettings, proof: &BestProof, cuts: &mut Cuts) -> Reasons {
    match &proof.reasons {
        KnownReasons::Levels(levels) => {
            let variable = |ends: &[_]| proof.variables.iter().position(|own| own.ends == ends);
            let stopped = levels.iter().filter_map(|level| {
                Some(Stopped {
                    variable: variable(&level.ends)?,
                    proof: level.cut.map(|cut| cuts.index_of(cut)),
                    over: Vec::new(),
                })
            });
            Reasons::LeastSlack(stopped.collect())
        }
        KnownReasons::Tree(tree) => {
            let cases = tree.iter().map(|case| cuts.case(case)).collect();
            match settings.objective {
                Objective::Volume => Reasons::Volume {
                    foot: volume_foot(),
                    cases,
                },
                Objective::Probability => Reasons::Probability(cases),
                _ => Reasons::Widths(cases),
            }
        }
    }
}

/// Returns the largest deviation at which an end of the variable still increases the objective, or
/// `None` if there is no limit. If it is the smaller one, it limits the variable instead of `most`.
fn greatest_gain(
    plan: &ParametrizedPlan,
    settings: &BestSettings,
    variable: &BoxVariable,
) -> Option<Rational> {
    let gains = variable.ends.iter().map(|end| {
        let place = end.parameter.index();
        let nominal = &plan.parameters[place].nominal;
        let chance = settings.distributions.get(place)?.as_ref();
        let [below, above] = chance.map_or_else(
            || [const { (Rational::ZERO, Some(Rational::ZERO)) }; 2],
            |chance| chance.limits(nominal),
        );
        match end.side {
            Side::Lower => below.1,
            Side::Upper => above.1,
        }
    });
    let gains: Option<Vec<Rational>> = gains.collect();
    gains.and_then(|own| own.into_iter().max())
}

/// Returns, for each variable, `true` if the reasons use its limit.
fn used_limits(reasons: &Reasons, variables: usize) -> Vec<bool> {
    let mut is_used = vec![false; variables];
    if let Reasons::LeastSlack(stopped) = reasons {
        for one in stopped {
            is_used[one.variable] |= one.proof.is_none();
        }
    }
    for case in reasons.cases() {
        if let Case::Sum(total) | Case::Impossible(total) = case {
            for own in &total.of {
                if let Source::Most(variable) = own.source {
                    is_used[variable] = true;
                }
            }
        }
    }
    is_used
}

/// Fills in the points that are at time 0 or later: each is the end point of the part before it.
fn fill_start_points(proof: &mut Proof, constraints: &[Constraint]) {
    match proof {
        Proof::Cycle(parts) => {
            let last = parts
                .last()
                .map_or(0, |part| end_of(part, &[], constraints));
            fill_start_points_of_parts(parts, last, &[], constraints);
        }
        Proof::Fixed(parts) => {
            // The executor chooses this point; the time of `point` is measured from it.
            let root = |mut point: usize| {
                let ending = |point: usize| {
                    let ends = |own: &&Constraint| own.observed && own.to == point;
                    constraints.iter().find(ends)
                };
                while let Some(link) = ending(point) {
                    point = link.from;
                }
                point
            };
            let mut at = parts
                .last()
                .map_or(0, |part| end_of(part, &[], constraints));
            for part in parts {
                if let Part::Beginning(point) = part {
                    *point = root(at);
                }
                at = end_of(part, &[], constraints);
            }
        }
        Proof::Semireducible { ways, cycle } => {
            let mut at = cycle
                .last()
                .map_or(0, |way| end_of(&Part::Way(*way), ways, constraints));
            // Start points of the ways. Later ways come first, because they mention earlier ones.
            let mut begins = vec![0; ways.len()];
            for &way in cycle.iter() {
                begins[way] = at;
                at = end_of(&Part::Way(way), ways, constraints);
            }
            for place in (0..ways.len()).rev() {
                let (earlier, own) = ways.split_at_mut(place);
                let mentioned = fill_start_points_of_parts(
                    &mut own[0].parts,
                    begins[place],
                    earlier,
                    constraints,
                );
                for (way, at) in mentioned {
                    begins[way] = at;
                }
            }
        }
        Proof::Assumed { .. } => {}
    }
}

/// Does the same for parts that begin at point `at`. Returns the ways that they mention, with their
/// start points.
fn fill_start_points_of_parts(
    parts: &mut [Part],
    mut at: usize,
    ways: &[Path],
    constraints: &[Constraint],
) -> Vec<(usize, usize)> {
    let mut mentioned = Vec::new();
    for part in parts {
        match part {
            Part::Beginning(point) => *point = at,
            Part::Way(way) => mentioned.push((*way, at)),
            _ => {}
        }
        at = end_of(part, ways, constraints);
    }
    mentioned
}

/// Returns the end point of a part of a proof.
fn end_of(part: &Part, ways: &[Path], constraints: &[Constraint]) -> usize {
    match part {
        Part::Beginning(_) => 0,
        Part::Least(index) | Part::Late(index) => constraints[*index].from,
        Part::Most(index) | Part::Early(index) => constraints[*index].to,
        Part::Way(way) => ways[*way]
            .parts
            .last()
            .map_or(0, |part| end_of(part, ways, constraints)),
    }
}

/// The cuts that are used, by first use.
#[derive(Default)]
struct Cuts {
    used: Vec<usize>,
    positions: BTreeMap<usize, usize>,
}

impl Cuts {
    /// Returns the position of a cut among those that are used, and appends it if it is new.
    fn index_of(&mut self, cut: usize) -> usize {
        let used = &mut self.used;
        *self.positions.entry(cut).or_insert_with(|| {
            used.push(cut);
            used.len() - 1
        })
    }

    fn case(&mut self, case: &KnownCase) -> Case {
        match case {
            KnownCase::AnyRow { cut, cases } => Case::Either {
                proof: self.index_of(*cut),
                cases: cases.clone(),
            },
            KnownCase::Split {
                variable,
                at,
                cases,
            } => Case::Split {
                variable: *variable,
                at: at.clone(),
                cases: *cases,
            },
            KnownCase::Bounded {
                multipliers,
                slopes,
                touches,
                is_impossible,
            } => {
                let used = multipliers.iter().filter(|(_, factor)| !factor.is_zero());
                let multipliers = used.map(|(source, factor)| Multiplier {
                    source: match *source {
                        KnownSource::Row(cut, row) => Source::Row(self.index_of(cut), row),
                        KnownSource::Most(variable) => Source::Most(variable),
                        KnownSource::Least(variable) => Source::Least(variable),
                    },
                    factor: factor.clone(),
                });
                let total = Total {
                    of: multipliers.collect(),
                    bound: Rational::ZERO,
                    slopes: slopes.iter().cloned().map(Exact).collect(),
                    touches: touches.iter().map(Into::into).collect(),
                    most: None,
                };
                if *is_impossible {
                    Case::Impossible(total)
                } else {
                    Case::Sum(total)
                }
            }
        }
    }
}

/// Returns the proof that one of the rows of a cut holds in every box inside the envelope.
fn proof_of(subject: &Subject<'_>, cut: &Cut) -> Proof {
    match &cut.ground {
        Ground::Cycle(origins) => Proof::Cycle(origins.iter().map(bound).collect()),
        // The bounds determine the durations that count at their ends.
        Ground::Fixed(parts) => Proof::Fixed(
            parts
                .iter()
                .filter_map(|part| match part {
                    ProofPart::Bound(origin) => Some(bound(origin)),
                    _ => None,
                })
                .collect(),
        ),
        Ground::Semireducible(cycle) => {
            let mut ways = Vec::new();
            let cycle = cycle.iter().map(|way| append_way(way, &mut ways)).collect();
            Proof::Semireducible { ways, cycle }
        }
        Ground::Condition(broken) => Proof::Assumed {
            why: subject.explainer.requirement(&broken.requirement),
            sums: sums(cut),
        },
        Ground::Box(_) => Proof::Assumed {
            why: "the plan fails for some values in each box that violates all of these".to_owned(),
            sums: sums(cut),
        },
    }
}

fn bound(origin: &Origin) -> Part {
    match *origin {
        // `begin` sets the point: it follows from the part before.
        Origin::Beginning => Part::Beginning(0),
        Origin::AtLeast(index) => Part::Least(index),
        Origin::AtMost(index) => Part::Most(index),
    }
}

/// Converts a part of a way, after the ways that it mentions.
fn part(part: &ProofPart, ways: &mut Vec<Path>) -> Part {
    match part {
        ProofPart::Bound(origin) => bound(origin),
        ProofPart::Early(index) => Part::Early(*index),
        ProofPart::Late(index) => Part::Late(*index),
        ProofPart::Path(inner) => Part::Way(append_way(inner, ways)),
    }
}

/// Appends a way after the ways that it mentions, and returns its position.
fn append_way(way: &ProofPath, ways: &mut Vec<Path>) -> usize {
    let parts = way.parts.iter().map(|inner| part(inner, ways)).collect();
    ways.push(Path {
        parts,
        unlabelled: way.unlabelled,
    });
    ways.len() - 1
}

/// Returns the rows of a cut as sums that are not negative.
fn sums(cut: &Cut) -> Vec<Sum> {
    let sum = |row: &elbowroom_envelope::Row| Sum {
        constant: row.bound.clone(),
        terms: row
            .factors
            .iter()
            .map(|(end, factor)| Term {
                parameter: end.parameter.index(),
                end: match end.side {
                    Side::Lower => End::Lower,
                    Side::Upper => End::Upper,
                },
                // A lower end is measured as a deviation, which grows as the end decreases.
                factor: match end.side {
                    Side::Lower => factor.clone(),
                    Side::Upper => &Rational::ZERO - factor,
                },
            })
            .collect(),
    };
    cut.rows.iter().map(sum).collect()
}
