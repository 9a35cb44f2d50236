//! Claims and assumptions of certificates, in words.

use crate::certificate::{Certificate, Proof, Reasons};
use crate::sound::{Condition, Control};

/// Returns the claim of a certificate.
pub(crate) fn proves(certificate: &Certificate) -> String {
    let is_inside = certificate.sound.as_ref().is_some_and(|sound| {
        let conditions = sound.conditions.as_ref();
        let is_proved = |own: &Condition| !own.cases.is_empty();
        sound.control != Control::Assumed && conditions.is_some_and(|own| own.iter().all(is_proved))
    });
    if is_inside {
        proves_all(certificate)
    } else {
        is_best(certificate).to_owned()
    }
}

/// Returns the claim of a certificate without any assumption.
pub(crate) fn proves_all(certificate: &Certificate) -> String {
    let best = is_best(certificate);
    format!("the box is inside the envelope, and {best}")
}

/// Returns the claim that no box is better.
fn is_best(certificate: &Certificate) -> &'static str {
    match certificate.reasons {
        Reasons::LeastSlack(_) => {
            "in no box inside the envelope has an end more slack, in relation to the nominal value, \
             unless an end that has no more than it gets less"
        }
        Reasons::Widths(_) => {
            "in no box inside the envelope is the weighted sum of widths greater than `bound`"
        }
        Reasons::Volume { .. } => {
            "in no box inside the envelope is the weighted sum of the logarithms of the widths, each \
             in relation to its `scale` and `foot` wider, greater than `bound`"
        }
        Reasons::Probability(_) => {
            "in no box inside the envelope is the sum of the logarithms of the probabilities of the \
             intervals, each half a `resolution` longer at both ends, greater than `bound`"
        }
    }
}

/// Assumption about the distributions of parameters, which are those of a world file.
pub(crate) const DISTRIBUTED: &str = "the parameters are independent of each other, each distributed as its `chance` \
                                      says, and one without it always at its nominal value";

/// Returns the assumptions of a certificate. Those of all certificates come first.
pub(crate) fn assumes(certificate: &Certificate) -> Vec<String> {
    let mut assumes = is_inside(certificate);
    assumes.push("the time points and constraints are those of the plan".to_owned());
    if matches!(certificate.reasons, Reasons::Probability(_)) {
        assumes.push(DISTRIBUTED.to_owned());
    }
    for (index, proof) in certificate.proofs.iter().enumerate() {
        if let Proof::Assumed { why, .. } = proof {
            assumes.push(format!("the inequalities of proof {index}: {why}"));
        }
    }
    assumes
}

/// Returns the assumptions of the claim that the box is inside the envelope.
fn is_inside(certificate: &Certificate) -> Vec<String> {
    const CHECKED: &str = "(`elbowroom envelope --contains` checks that)";
    let Some(sound) = &certificate.sound else {
        return vec![format!("the box itself is inside the envelope {CHECKED}")];
    };
    let mut assumes = Vec::new();
    if sound.control == Control::Assumed {
        assumes.push(format!(
            "for all values in the box there are times for all points, as the guarantee demands \
             {CHECKED}"
        ));
    }
    match &sound.conditions {
        None => assumes.push(format!(
            "in all schedules for values in the box, the conditions of the plan hold {CHECKED}"
        )),
        Some(conditions) => {
            let stated = conditions.iter().filter(|own| own.cases.is_empty());
            assumes.extend(stated.map(|own| {
                format!(
                    "in all schedules for values in the box: {} {CHECKED}",
                    own.why
                )
            }));
            assumes.push(
                "the conditions of the plan are those of `conditions`, and fail only in the ways \
                 told there"
                    .to_owned(),
            );
        }
    }
    assumes
}
