//! Influence of effects, and of spontaneous changes, on the probability of a fact.

use super::cluster::Kernel;
use crate::likelihoods::{Rate, SpontaneousChange};
use crate::model::{FactEffect, Model, Semantics};

/// An effect with its success probability.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Outcome {
    pub(super) fact: usize,
    pub(super) makes_true: bool,
    pub(super) probability: f64,
    pub(super) is_certain: bool,
}

impl From<&FactEffect> for Outcome {
    fn from(effect: &FactEffect) -> Self {
        Self {
            fact: effect.fact,
            makes_true: effect.makes_true,
            probability: effect.probability,
            is_certain: effect.is_certain,
        }
    }
}

/// Parts of a step other than guarded effects.
pub(super) struct Pending {
    /// Unconditional effects on other facts.
    pub(super) independent: Vec<Outcome>,
    /// `true` if facts change by themselves afterwards.
    pub(super) is_step: bool,
}

/// Returns the transition of a fact by spontaneous changes in a step.
pub(super) fn spontaneous_kernel(flip: SpontaneousChange) -> Kernel {
    Kernel {
        if_true: 1.0 - flip.becomes_false,
        if_false: flip.becomes_true,
    }
}

/// Returns the transition of a fact by spontaneous changes while time passes.
pub(super) fn rate_kernel(rate: Rate, seconds: f64) -> Kernel {
    let (if_true, if_false) = rate.probabilities_after(seconds);
    Kernel { if_true, if_false }
}

/// Returns the transition of a fact by the effects that take place; deletions come before
/// additions.
pub(super) fn kernel<'a>(
    model: &Model,
    fact: usize,
    outcomes: impl Iterator<Item = &'a Outcome>,
    is_step: bool,
) -> Kernel {
    let (mut stays, mut comes_not) = (1.0, 1.0);
    let (mut adds, mut deletes, mut is_certain) = (false, false, false);
    for outcome in outcomes {
        is_certain |= outcome.is_certain;
        if outcome.makes_true {
            adds = true;
            comes_not *= 1.0 - outcome.probability;
        } else {
            deletes = true;
            stays *= 1.0 - outcome.probability;
        }
    }
    let flip = model.spontaneous_changes[fact];
    if !adds && !deletes {
        return if is_step {
            spontaneous_kernel(flip)
        } else {
            Kernel {
                if_true: 1.0,
                if_false: 0.0,
            }
        };
    }
    let comes = 1.0 - comes_not;
    match model.semantics() {
        // A deletion that fails leaves the fact true, an addition that fails leaves it false.
        Semantics::Paper => {
            let rest = if deletes { stays } else { 0.0 };
            let p = comes + comes_not * rest;
            Kernel {
                if_true: p,
                if_false: p,
            }
        }
        Semantics::World => {
            let after = Kernel {
                if_true: stays + (1.0 - stays) * comes,
                if_false: comes,
            };
            if is_step && !is_certain {
                let flipped = spontaneous_kernel(flip);
                Kernel {
                    if_true: flipped.apply(after.if_true),
                    if_false: flipped.apply(after.if_false),
                }
            } else {
                after
            }
        }
    }
}
