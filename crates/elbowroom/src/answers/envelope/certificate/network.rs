//! The plan's network in a certificate.

use elbowroom_envelope::Guarantee;
use elbowroom_plan::{Bound, DecoupledEnvelope, ParametrizedPlan, Side};
use elbowroom_verify::{Constraint, Exact, Limit, Part, Proof};

/// Returns the plan's constraints, as an executor with this guarantee has to satisfy them.
pub(super) fn constraints(plan: &ParametrizedPlan, guarantee: Guarantee) -> Vec<Constraint> {
    let nominal = DecoupledEnvelope::point(&plan.nominal());
    // Except under weak controllability, contingent links are distinguished from bounds that the
    // executor satisfies by its choices.
    let (is_weak, network) = match guarantee {
        Guarantee::Weak => (true, None),
        _ => (false, plan.uncertain_network(&nominal).ok()),
    };
    let observed = network.map(|network| network.links).unwrap_or_default();
    let limit = |bound: &Bound| match bound {
        Bound::Infinite => Limit::None,
        Bound::Finite(value) => Limit::Number(Exact(value.clone())),
        Bound::Parameter(id) => Limit::Parameter(id.index()),
    };
    let all = plan.plan.constraints.iter().enumerate();
    all.map(|(index, constraint)| {
        let told = plan.commanded_duration(constraint).filter(|_| !is_weak);
        let told = told.map(|planned| Limit::Number(Exact(planned.clone())));
        Constraint {
            from: constraint.from.index(),
            to: constraint.to.index(),
            lower: told.clone().unwrap_or_else(|| limit(&constraint.lower)),
            upper: told.unwrap_or_else(|| limit(&constraint.upper)),
            observed: observed.contains(&index),
        }
    })
    .collect()
}

/// Returns the constraints that the proofs use, without bounds that no proof uses, and renumbers
/// them in the proofs. A proof about times that are fixed in advance also uses all durations that
/// are not fixed.
pub(super) fn used_constraints(all: Vec<Constraint>, proofs: &mut [Proof]) -> Vec<Constraint> {
    let mut is_used = vec![false; all.len()];
    let mut sides = vec![[false; 2]; all.len()];
    for proof in proofs.iter_mut() {
        if matches!(proof, Proof::Fixed(_)) {
            let observed = all.iter().map(|constraint| constraint.observed);
            for (is_used, is_observed) in is_used.iter_mut().zip(observed) {
                *is_used |= is_observed;
            }
        }
        each_constraint(proof, &mut |index, _| is_used[*index] = true);
        each_constraint(proof, &mut |index, side| sides[*index][side.index()] = true);
    }
    let mut places = vec![0; all.len()];
    let mut used = Vec::new();
    for (index, mut constraint) in all.into_iter().enumerate() {
        if is_used[index] {
            places[index] = used.len();
            let [is_lower, is_upper] = sides[index];
            for (limit, is_used) in [
                (&mut constraint.lower, is_lower),
                (&mut constraint.upper, is_upper),
            ] {
                if !is_used && !constraint.observed {
                    *limit = Limit::None;
                }
            }
            used.push(constraint);
        }
    }
    for proof in proofs {
        each_constraint(proof, &mut |index, _| *index = places[*index]);
    }
    used
}

/// Visits the positions of constraints in a proof, with the bound that is used.
fn each_constraint(proof: &mut Proof, visit: &mut dyn FnMut(&mut usize, Side)) {
    match proof {
        Proof::Cycle(parts) | Proof::Fixed(parts) => each_in_parts(parts, visit),
        Proof::Semireducible { ways, .. } => {
            for way in ways {
                each_in_parts(&mut way.parts, visit);
                if let Some(index) = &mut way.unlabelled {
                    visit(index, Side::Lower);
                }
            }
        }
        Proof::Assumed { .. } => {}
    }
}

fn each_in_parts(parts: &mut [Part], visit: &mut dyn FnMut(&mut usize, Side)) {
    for part in parts {
        match part {
            Part::Beginning(_) | Part::Way(_) => {}
            Part::Least(index) | Part::Early(index) => visit(index, Side::Lower),
            Part::Most(index) | Part::Late(index) => visit(index, Side::Upper),
        }
    }
}
