//! What a certificate proves and what it takes for granted, in words.

use crate::certificate::{Certificate, Proof, Reasons};

/// What follows if the certificate is right.
pub(crate) fn proves(certificate: &Certificate) -> &'static str {
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

/// What has to be known from elsewhere, the same in all certificates first.
pub(crate) fn assumes(certificate: &Certificate) -> Vec<String> {
    let mut assumes = vec![
        "the box itself is inside the envelope (`elbowroom envelope --contains` checks that)"
            .to_owned(),
        "the time points and constraints are those of the plan".to_owned(),
    ];
    if matches!(certificate.reasons, Reasons::Probability(_)) {
        assumes.push(
            "the parameters are independent of each other, each distributed as its `chance` says, and \
             one without it always at its nominal value"
                .to_owned(),
        );
    }
    for (index, proof) in certificate.proofs.iter().enumerate() {
        if let Proof::Assumed { why, .. } = proof {
            assumes.push(format!("the inequalities of proof {index}: {why}"));
        }
    }
    assumes
}
