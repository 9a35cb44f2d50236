//! The distribution as one value, for comparisons: [`Snapshot`].

use super::Facts;
use crate::model::Model;

/// Distribution of some facts at one moment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Snapshot {
    /// P(true) of independent facts.
    pub(crate) single: Vec<(usize, f64)>,
    /// Coupled facts, sorted, with the weights of their assignments.
    pub(crate) coupled: Vec<(Vec<usize>, Vec<f64>)>,
}

impl Facts {
    /// Returns the distribution of the relevant facts. A cluster is relevant as a whole.
    pub(in crate::network) fn snapshot(
        &mut self,
        model: &Model,
        is_relevant: &dyn Fn(usize) -> bool,
    ) -> Snapshot {
        let mut snapshot = Snapshot {
            single: Vec::new(),
            coupled: Vec::new(),
        };
        let mut slots: Vec<u32> = Vec::new();
        for fact in 0..self.records.len() {
            if !is_relevant(fact) {
                continue;
            }
            match self.records[fact].cluster {
                None => {
                    let p = self.independent_probability(model, fact);
                    snapshot.single.push((fact, p));
                }
                Some(slot) if !slots.contains(&slot) => slots.push(slot),
                Some(_) => {}
            }
        }
        for slot in slots {
            let cluster = self.cluster(model, slot).clone();
            let mut order: Vec<usize> = (0..cluster.facts.len()).collect();
            order.sort_by_key(|&place| cluster.facts[place]);
            let weights = (0..cluster.weights.len())
                .map(|index| {
                    let bits = order.iter().enumerate();
                    let old: usize = bits.map(|(new, &old)| ((index >> new) & 1) << old).sum();
                    cluster.weights[old]
                })
                .collect();
            let facts = order.iter().map(|&place| cluster.facts[place]).collect();
            snapshot.coupled.push((facts, weights));
        }
        snapshot
    }
}
