//! Joint distribution of a few facts that a condition has coupled.

/// Transition probabilities of a fact under an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Kernel {
    /// P(true after | true before).
    pub(super) if_true: f64,
    /// P(true after | false before).
    pub(super) if_false: f64,
}

impl Kernel {
    /// Returns the probability of being true afterwards.
    pub(super) fn apply(self, p: f64) -> f64 {
        p * self.if_true + (1.0 - p) * self.if_false
    }
}

/// A normalized distribution: bit `i` of an index into `weights` is the truth of `facts[i]`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Cluster {
    pub(super) facts: Vec<usize>,
    pub(super) layer: u32,
    pub(super) weights: Vec<f64>,
}

impl Cluster {
    /// Returns the distribution of no facts.
    pub(super) fn unit(layer: u32) -> Self {
        Self {
            facts: Vec::new(),
            layer,
            weights: vec![1.0],
        }
    }

    /// Multiplies with an independent distribution at the same layer.
    pub(super) fn extend(&mut self, facts: &[usize], weights: &[f64]) {
        self.facts.extend_from_slice(facts);
        let old = std::mem::take(&mut self.weights);
        self.weights = weights
            .iter()
            .flat_map(|outer| old.iter().map(move |inner| outer * inner))
            .collect();
    }

    pub(super) fn place(&self, fact: usize) -> usize {
        let place = self.facts.iter().position(|&own| own == fact);
        place.expect("the fact is in this cluster")
    }

    /// Changes one fact, independently of the others.
    pub(super) fn transform(&mut self, place: usize, kernel: Kernel) {
        let bit = 1 << place;
        for index in 0..self.weights.len() {
            if index & bit != 0 {
                let (with, without) = (self.weights[index], self.weights[index ^ bit]);
                self.weights[index] = with * kernel.if_true + without * kernel.if_false;
                self.weights[index ^ bit] =
                    with * (1.0 - kernel.if_true) + without * (1.0 - kernel.if_false);
            }
        }
    }

    /// Changes the facts at `places`, depending on the previous assignment.
    ///
    /// `kernels` returns the changes for an assignment, one for each of the places.
    pub(super) fn transform_jointly(
        &mut self,
        places: &[usize],
        mut kernels: impl FnMut(usize) -> Vec<Kernel>,
    ) {
        let targets: usize = places.iter().map(|place| 1 << place).sum();
        let mut after = vec![0.0; self.weights.len()];
        for (before, &weight) in self.weights.iter().enumerate() {
            if weight == 0.0 {
                continue;
            }
            let mut outcomes = vec![(before & !targets, weight)];
            for (place, kernel) in places.iter().zip(kernels(before)) {
                let bit = 1 << place;
                let was_true = before & bit != 0;
                let p = if was_true {
                    kernel.if_true
                } else {
                    kernel.if_false
                };
                let mut next = Vec::with_capacity(outcomes.len() * 2);
                for (index, weight) in outcomes {
                    next.push((index | bit, weight * p));
                    next.push((index, weight * (1.0 - p)));
                }
                outcomes = next;
            }
            for (index, weight) in outcomes {
                after[index] += weight;
            }
        }
        self.weights = after;
    }

    /// Conditions on the assignments for which `keeps` holds, and returns their probability.
    pub(super) fn condition(&mut self, mut keeps: impl FnMut(usize) -> bool) -> f64 {
        let mut mass = 0.0;
        for (index, weight) in self.weights.iter_mut().enumerate() {
            if *weight > 0.0 && !keeps(index) {
                *weight = 0.0;
            }
            mass += *weight;
        }
        if mass > 0.0 {
            for weight in &mut self.weights {
                *weight /= mass;
            }
        }
        mass
    }

    /// Returns the probability of the assignments for which `counts` holds.
    pub(super) fn mass(&self, mut counts: impl FnMut(usize) -> bool) -> f64 {
        let weights = self.weights.iter().enumerate();
        weights
            .filter(|(index, weight)| **weight > 0.0 && counts(*index))
            .map(|(_, weight)| weight)
            .sum()
    }

    /// Returns the probability that one fact is true.
    pub(super) fn marginal(&self, place: usize) -> f64 {
        self.mass(|index| index & (1 << place) != 0)
    }

    /// Sums one fact out.
    pub(super) fn remove(&mut self, place: usize) {
        let bit = 1 << place;
        let low = bit - 1;
        let half = self.weights.len() / 2;
        self.weights = (0..half)
            .map(|rest| {
                let index = (rest & low) | ((rest & !low) << 1);
                self.weights[index] + self.weights[index | bit]
            })
            .collect();
        self.facts.remove(place);
    }
}
