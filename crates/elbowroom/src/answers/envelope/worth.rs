//! What it would be worth to relax a bound of the plan: the duals of the largest box.

use std::collections::BTreeMap;

use elbowroom_envelope::{BestProof, Case, Cut, Ground, ProofPart, ProofWay, Reasons, Source};
use elbowroom_num::Rational;
use elbowroom_plan::{Origin, Reason};
use serde::{Deserialize, Serialize};

use super::Subject;
use crate::answers::exact;

/// What the objective gains for each unit by which a bound of the plan is relaxed, as long as
/// nothing else comes to limit it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Worth {
    /// The bound, in words.
    pub bound: String,
    /// Whether there is more room with more or with less of it.
    pub relax: Relax,
    /// How much the objective gains.
    #[serde(with = "exact")]
    pub gain: Rational,
}

/// The direction in which a bound is relaxed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Relax {
    /// An upper bound.
    More,
    /// A lower bound.
    Less,
}

/// What each bound is worth, the most first; nothing where the best box is one of several cases.
pub(super) fn worths(subject: &Subject<'_>, proof: &BestProof) -> Vec<Worth> {
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
        // Orders follow from the domain, and what is open has no number to relax.
        let is_bound = matches!(
            constraint.reason,
            Reason::Given | Reason::Duration(_) | Reason::Timed(_)
        );
        is_bound && constraint.lower.parameter().is_none() && constraint.upper.parameter().is_none()
    };
    let mut worths: Vec<Worth> = gains
        .into_iter()
        .filter(|((index, _), gain)| gain.is_positive() && is_somebodys(*index))
        .map(|((index, relax), gain)| Worth {
            bound: subject.explainer.constraint(index),
            relax,
            gain,
        })
        .collect();
    worths.sort_by(|one, other| other.gain.cmp(&one.gain));
    worths
}

/// The cuts that limit the objective, with what the objective gains when their bound grows by 1.
fn multipliers(proof: &BestProof) -> Vec<(&Cut, Rational)> {
    let single = |cut: usize| Some(&proof.cuts[cut]).filter(|cut| cut.rows.len() == 1);
    match &proof.reasons {
        Reasons::Tree(tree) => {
            let [Case::Bounded { multipliers, .. }] = &tree[..] else {
                return Vec::new();
            };
            let used = multipliers.iter().filter_map(|(source, factor)| {
                let Source::Row(cut, _) = source else {
                    return None;
                };
                Some((single(*cut)?, factor.clone()))
            });
            used.collect()
        }
        Reasons::Levels(levels) => {
            // The least slack is that of the first one stopped.
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

/// The bounds that a cut is made of, and how often each counts.
fn bounds(cut: &Cut) -> Vec<(Origin, i64)> {
    fn of_part(part: &ProofPart, found: &mut Vec<(Origin, i64)>) {
        match part {
            ProofPart::Bound(origin) => found.push((*origin, 1)),
            ProofPart::Early(_) | ProofPart::Late(_) => {}
            ProofPart::Way(way) => of_way(way, found),
        }
    }
    fn of_way(way: &ProofWay, found: &mut Vec<(Origin, i64)>) {
        for part in &way.parts {
            of_part(part, found);
        }
    }
    let mut found = Vec::new();
    match &cut.ground {
        Ground::Cycle(origins) => found.extend(origins.iter().map(|origin| (*origin, 1))),
        Ground::Fixed(parts) => parts.iter().for_each(|part| of_part(part, &mut found)),
        Ground::Semireducible(ways) => ways.iter().for_each(|way| of_way(way, &mut found)),
        Ground::Condition(_) | Ground::Box(_) => {}
    }
    found
}
