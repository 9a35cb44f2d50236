//! World with exactly the given likelihoods: [`SoundWorld`].

use crate::untimed::UntimedWorld;
use elbowroom_model::State;
use elbowroom_model::ground::Action;
use elbowroom_probability::likelihoods::FailureOutcome;
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::event_probabilities::{EffectProbability, EventProbabilities};
use elbowroom_sim::draw::{Purpose, keyed};

/// World with independent draws.
///
/// An attempt to start succeeds with its probability, and so does an end. Each effect takes place
/// with its own probability, and otherwise leaves the fact unchanged; deletions come before
/// additions. A failed end has none of its effects, but one of the outcomes of its failure. After
/// each attempt and each end, successful or not, every fact may change spontaneously once.
///
/// It is the world of [`optimum`](elbowroom_probability::optimum). Starts, ends, effects and
/// changes have separate random sources that depend only on the seed, so two executors with the
/// same steps have the same results.
#[derive(Clone, Debug)]
pub struct SoundWorld<'a> {
    chances: &'a EventProbabilities,
    state: State,
    starts: ChaCha8Rng,
    ends: ChaCha8Rng,
    effects: ChaCha8Rng,
    changes: ChaCha8Rng,
}

impl<'a> SoundWorld<'a> {
    /// Creates the world of that seed in this state.
    pub fn new(chances: &'a EventProbabilities, initial: &State, seed: u64) -> Self {
        Self {
            chances,
            state: initial.clone(),
            starts: keyed(seed, "", 0, Purpose::Failure),
            ends: keyed(seed, "", 1, Purpose::Failure),
            effects: keyed(seed, "", 0, Purpose::Effect),
            changes: keyed(seed, "", 0, Purpose::Change),
        }
    }

    fn apply_random_effects(&mut self, effects: &[EffectProbability]) {
        for effect in effects {
            if self.effects.random::<f64>() >= effect.probability {
                continue;
            }
            if effect.makes_true {
                self.state.facts.insert(effect.fact);
            } else {
                self.state.facts.remove(&effect.fact);
            }
        }
    }

    /// Applies a random outcome of a failure.
    fn apply_failure_outcome(&mut self, aftermaths: &[FailureOutcome]) {
        let mut left = self.ends.random::<f64>();
        let drawn = aftermaths.iter().find(|aftermath| {
            left -= aftermath.probability;
            left < 0.0
        });
        // If a rounding error keeps the sum below 1, the last outcome has the rest.
        let Some(aftermath) = drawn.or(aftermaths.last()) else {
            return;
        };
        for &(fact, becomes) in &aftermath.changes {
            if becomes {
                self.state.facts.insert(fact);
            } else {
                self.state.facts.remove(&fact);
            }
        }
    }

    fn apply_spontaneous_changes(&mut self) {
        for &(fact, flip) in &self.chances.flips {
            let draw = self.changes.random::<f64>();
            if self.state.facts.contains(&fact) {
                if draw < flip.becomes_false {
                    self.state.facts.remove(&fact);
                }
            } else if draw < flip.becomes_true {
                self.state.facts.insert(fact);
            }
        }
    }
}

impl UntimedWorld for SoundWorld<'_> {
    fn state(&self) -> &State {
        &self.state
    }

    fn attempt(&mut self, action: &Action) -> bool {
        let chances = self.chances.of(action);
        let draw = self.starts.random::<f64>();
        let started = chances.filter(|chances| draw < chances.start);
        if let Some(chances) = started {
            self.apply_random_effects(&chances.start_effects);
        }
        self.apply_spontaneous_changes();
        started.is_some()
    }

    fn end(&mut self, action: &Action) -> bool {
        let mut has_succeeded = true;
        if let Some(chances) = self.chances.of(action) {
            has_succeeded = self.ends.random::<f64>() < chances.end;
            if has_succeeded {
                self.apply_random_effects(&chances.end_effects);
            } else {
                self.apply_failure_outcome(&chances.aftermaths);
            }
        }
        self.apply_spontaneous_changes();
        has_succeeded
    }
}
