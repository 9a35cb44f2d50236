//! Belief about the state of the world: [`Belief`].

use std::collections::BTreeMap;

use elbowroom_model::State;
use elbowroom_model::ground::FactId;

/// Probability of each fact; the facts are independent of each other.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Belief {
    /// Facts that are not listed are certainly false.
    probabilities: BTreeMap<FactId, f64>,
}

impl Belief {
    /// Creates a belief that is certain about a state.
    pub fn certain(state: &State) -> Self {
        Self {
            probabilities: state.facts.iter().map(|&fact| (fact, 1.0)).collect(),
        }
    }

    /// Returns the probability that the fact holds.
    pub fn probability(&self, fact: FactId) -> f64 {
        self.probabilities.get(&fact).copied().unwrap_or(0.0)
    }

    /// Sets the probability that the fact holds, clamped to [0, 1].
    pub fn set(&mut self, fact: FactId, probability: f64) {
        let probability = if probability.is_nan() {
            0.0
        } else {
            probability
        };
        let probability = probability.clamp(0.0, 1.0);
        if probability > 0.0 {
            self.probabilities.insert(fact, probability);
        } else {
            self.probabilities.remove(&fact);
        }
    }

    /// Returns the facts that may hold, with their probabilities.
    pub fn iter(&self) -> impl Iterator<Item = (FactId, f64)> + '_ {
        self.probabilities.iter().map(|(&fact, &p)| (fact, p))
    }
}

impl From<&State> for Belief {
    fn from(state: &State) -> Self {
        Self::certain(state)
    }
}
