//! The answer of the embedded planner to a problem that has a plan.

use std::ops::ControlFlow;

use elbowroom_model::validate::{Settings as Strictness, Verdict};
use elbowroom_model::{Situation, validate_from};
use elbowroom_planner::{Answer, Proof, Settings, plan};

use super::Solvable;

/// Kind of answer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Outcome {
    /// A valid plan.
    Found,
    /// No plan within the budget, or within what the search can reach.
    NoneFound(String),
    /// "No plan exists", which is false.
    FalseClaim(String),
    /// The planner refuses a feature.
    Unsupported(String),
    /// The validator rejects the plan.
    Invalid(String),
}

/// Number of answers of each kind.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) problems: usize,
    pub(crate) found: usize,
    pub(crate) none_found: usize,
    pub(crate) false_claims: usize,
    pub(crate) unsupported: usize,
    pub(crate) invalid: usize,
}

impl Tally {
    pub(crate) fn count(&mut self, outcome: &Outcome) {
        self.problems += 1;
        *match outcome {
            Outcome::Found => &mut self.found,
            Outcome::NoneFound(_) => &mut self.none_found,
            Outcome::FalseClaim(_) => &mut self.false_claims,
            Outcome::Unsupported(_) => &mut self.unsupported,
            Outcome::Invalid(_) => &mut self.invalid,
        } += 1;
    }
}

/// Asks the planner for a plan, with self-overlap if there is some in the problem's own plan.
/// Evaluates at most about `states` states, or a tenth of that where each
/// state is a linear program.
pub(crate) fn outcome(solvable: &Solvable, states: u64) -> Outcome {
    outcome_with(solvable, states, solvable.overlaps_itself())
}

/// The same, with or without self-overlap. Without it, a problem whose own plan needs it may have no plan.
pub(crate) fn outcome_with(solvable: &Solvable, states: u64, self_overlap: bool) -> Outcome {
    let task = solvable.task();
    let situation = Situation::initial(&task);
    let settings = Settings {
        first_plan_only: true,
        max_memory: 256 << 20,
        self_overlap,
        ..Settings::default()
    };
    let features = solvable.features;
    let is_symbolic = features.continuous || features.reads_duration && features.inequalities;
    let states = if is_symbolic { states / 10 } else { states };
    let answer = plan(&task, &situation, &settings, &mut |progress| {
        if progress.counts.evaluated < states {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    });
    match answer {
        Answer::Plan { found, .. } => {
            match validate_from(&task, &situation, &found.plan, &Strictness::default()) {
                Verdict::Valid(_) if !self_overlap && found.plan.self_overlap().is_some() => {
                    Outcome::Invalid("an action overlaps itself".to_owned())
                }
                Verdict::Valid(_) => Outcome::Found,
                verdict => Outcome::Invalid(format!("{verdict:?}")),
            }
        }
        Answer::Unsolvable {
            proof: proof @ Proof::WithoutSelfOverlap { .. },
            ..
        } if solvable.overlaps_itself() => Outcome::NoneFound(proof.to_string()),
        Answer::Unsolvable { proof, .. } => Outcome::FalseClaim(proof.to_string()),
        Answer::NoneFound { stopped, .. } => Outcome::NoneFound(format!("{stopped:?}")),
        Answer::Unsupported(unsupported) => Outcome::Unsupported(unsupported.to_string()),
    }
}
