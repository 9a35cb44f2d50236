//! A plan with the situation from which it starts.

use elbowroom_model::{Situation, TimeTriggeredPlan};

use super::settings::{MissingPlan, Verdict};
use super::situation::StartedPlan;
use crate::event::ActionHandle;
use crate::preparation::PrepareError;

/// A plan, with the situation from which it starts.
#[derive(Clone, Copy)]
pub(super) struct PlanStart<'p> {
    pub(super) plan: &'p TimeTriggeredPlan,
    pub(super) situation: &'p Situation,
    /// The tickets of the actions that are running there.
    pub(super) running: &'p [ActionHandle],
    /// The steps that have begun between the plan's start and its adoption.
    pub(super) begun_steps: &'p [ActionHandle],
}

impl<'p> PlanStart<'p> {
    /// Creates the start of a plan with no step begun.
    pub(super) fn of((plan, situation, running): &'p StartedPlan) -> Self {
        Self {
            plan,
            situation,
            running,
            begun_steps: &[],
        }
    }

    /// Returns a copy of the plan with its start.
    pub(super) fn to_owned(self) -> StartedPlan {
        (
            self.plan.clone(),
            self.situation.clone(),
            self.running.to_vec(),
        )
    }
}

/// Returns the verdict of a run whose plan cannot be prepared.
pub(super) fn preparation_failure(error: &PrepareError) -> Verdict {
    let why = error.to_string();
    let missing = MissingPlan::NotSearched;
    Verdict::NoPlan { why, missing }
}
