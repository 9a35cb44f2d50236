//! Detection of actions that succeed repeatedly in the same state: [`Repetitions`].

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::State;
use elbowroom_model::ground::{FactId, FluentId};
use elbowroom_num::Rational;
use elbowroom_plan::InstanceId;

use crate::executor::StepId;

/// Limit on the number of states that are kept. Beyond it, all are forgotten.
const MAX_STATES: usize = 4096;

/// Facts, numbers and running actions at the start of an action, and the action.
type RepetitionKey = (
    BTreeSet<FactId>,
    BTreeMap<FluentId, Rational>,
    Vec<InstanceId>,
    InstanceId,
);

/// Number of successes of actions by the state at their start.
///
/// An executor that always makes the same choice in the same state repeats such a cycle forever,
/// unless the world changes spontaneously. Likelihoods may predict such changes for a world without
/// them.
#[derive(Clone, Debug, Default)]
pub(super) struct Repetitions {
    started: BTreeMap<StepId, RepetitionKey>,
    successes: BTreeMap<RepetitionKey, u32>,
}

impl Repetitions {
    /// Returns the number of successes of an action after a start in this state.
    pub(super) fn count(&self, state: &State, running: &[InstanceId], instance: InstanceId) -> u32 {
        let place = repetition_key(state, running, instance);
        self.successes.get(&place).copied().unwrap_or(0)
    }

    /// Records the start of an action.
    pub(super) fn start(
        &mut self,
        step: StepId,
        state: &State,
        running: &[InstanceId],
        instance: InstanceId,
    ) {
        self.started
            .insert(step, repetition_key(state, running, instance));
    }

    /// Records the end of an action.
    pub(super) fn end(&mut self, step: StepId, succeeded: bool) {
        let Some(place) = self.started.remove(&step).filter(|_| succeeded) else {
            return;
        };
        if self.successes.len() >= MAX_STATES {
            self.successes.clear();
        }
        *self.successes.entry(place).or_default() += 1;
    }
}

fn repetition_key(state: &State, running: &[InstanceId], instance: InstanceId) -> RepetitionKey {
    let mut running = running.to_vec();
    running.sort_unstable();
    (state.facts.clone(), state.values.clone(), running, instance)
}
