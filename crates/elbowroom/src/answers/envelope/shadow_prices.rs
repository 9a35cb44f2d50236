//! Gains from relaxing bounds of the plan: the duals of the largest box.

use std::collections::BTreeMap;

use elbowroom_envelope::{
    BestProof, BoundSource, Cut, Ground, OptimalityProof, ProofCase, ProofPart, ProofPath,
};
use elbowroom_num::Rational;
use elbowroom_plan::{Origin, Reason};
use serde::{Deserialize, Serialize};

use super::Subject;
use crate::answers::exact;

/// Gain of the objective per unit of relaxation of a bound of the plan, as long as no other bound
/// becomes the limit.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ShadowPrices {
    /// The bound, in words.
    pub bound: String,
    /// Direction of the relaxation.
    pub relax: Relax,
    /// Gain of the objective per unit.
    #[serde(with = "exact")]
    pub gain: Rational,
}

/// Direction in a relaxation of a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Relax {
    /// An upper bound is increased.
    More,
    /// A lower bound is decreased.
    Less,
}

/// Returns the gains of the bounds, largest first; empty if the best box is one of several cases.
pub(super) fn shadow_prices(subject: &Subject<'_>, proof: &BestProof) -> Vec<ShadowPrices> {
    let mut gains: BTreeMap<(usize, Relax), Rational> = BTreeMap::new();
    for (cut, multiplier) in multipliers(proof) {
        for (origin, count) in bounds(cut) {
            let (index, relax) = match origin {
                Origin::Beginning => continue,
                Origin::AtMost(index) => (index, Relax::More),
                Origin::AtLeast(index) => (index, Relax::Less),
            };
            *gains.entry((index, relax)).or_default() += &multiplier * &Rational::from(count);
        }
    }
    let plan = subject.plan;
    let is_somebodys = |index: usize| {
        let constraint = &plan.plan.constraints[index];
        // Orderings follow from the domain, and open bounds have no number to relax.
        let is_bound = matches!(
            constraint.reason,
            Reason::Given | Reason::Duration(_) | Reason::Timed(_)
        );
        is_bound && constraint.lower.parameter().is_none() && constraint.upper.parameter().is_none()
    };
    let mut worths: Vec<ShadowPrices> = gains
        .into_iter()
        .filter(|((index, _), gain)| gain.is_positive() && is_somebodys(*index))
        .map(|((index, relax), gain)| ShadowPrices {
            bound: subject.explainer.constraint(index),
            relax,
            gain,
        })
        .collect();
    worths.sort_by(|one, other| other.gain.cmp(&one.gain));
    worths
}

/// Returns the cuts that limit the objective, each with the gain of the objective when the cut's
/// bound grows by 1.
fn multipliers(proof: &BestProof) -> Vec<(&Cut, Rational)> {
    let single = |cut: usize| Some(&proof.cuts[cut]).filter(|cut| cut.rows.len() == 1);
    match &proof.reasons {
        OptimalityProof::Tree(tree) => {
            let [ProofCase::Bounded { multipliers, .. }] = &tree[..] else {
                return Vec::new();
            };
            let used = multipliers.iter().filter_map(|(source, factor)| {
                let BoundSource::Row(cut, _) = source else {
                    return None;
                };
                Some((single(*cut)?, factor.clone()))
            });
            used.collect()
        }
        OptimalityProof::Levels(levels) => {
            // The least slack is that of the first stopped level.
            let Some(first) = levels.first() else {
                return Vec::new();
            };
            let Some(cut) = first.cut.and_then(single) else {
                return Vec::new();
            };
            let moving = proof.variables.iter().filter(|own| {
                let slack = own.value.checked_div(&own.scale);
                slack.is_some_and(|slack| slack >= first.slack)
            });
            let sum: Rational = moving
                .flat_map(|own| own.ends.iter().map(move |end| (end, &own.scale)))
                .filter_map(|(end, scale)| Some(cut.rows[0].factors.get(*end)? * scale))
                .sum();
            let gain = Rational::ONE.checked_div(&sum);
            gain.map(|gain| (cut, gain)).into_iter().collect()
        }
    }
}

/// Returns the bounds that a cut consists of, with their multiplicities.
fn bounds(cut: &Cut) -> Vec<(Origin, i64)> {
    fn collect_from_part(part: &ProofPart, found: &mut Vec<(Origin, i64)>) {
        match part {
            ProofPart::Bound(origin) => found.push((*origin, 1)),
            ProofPart::Early(_) | ProofPart::Late(_) => {}
            ProofPart::Path(way) => collect_from_way(way, found),
        }
    }
    fn collect_from_way(way: &ProofPath, found: &mut Vec<(Origin, i64)>) {
        for part in &way.parts {
            collect_from_part(part, found);
        }
    }
    let mut found = Vec::new();
    match &cut.ground {
        Ground::Cycle(origins) => found.extend(origins.iter().map(|origin| (*origin, 1))),
        Ground::Fixed(parts) => parts
            .iter()
            .for_each(|part| collect_from_part(part, &mut found)),
        Ground::Semireducible(ways) => ways
            .iter()
            .for_each(|way| collect_from_way(way, &mut found)),
        Ground::Condition(_) | Ground::Box(_) => {}
    }
    found
}
