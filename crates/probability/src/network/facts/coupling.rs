//! Coupling of facts: entering a cluster and leaving it.

use elbowroom_model::ground::FactId;

use super::super::cluster::Cluster;
use super::super::outcome::{rate_kernel, spontaneous_kernel};
use super::{Facts, MAX_COUPLED, Record};
use crate::model::Model;

impl Facts {
    /// Returns those of these facts that are not certain in the present layer.
    pub(super) fn open(&mut self, model: &Model, facts: &[usize]) -> Vec<usize> {
        let mut open = Vec::new();
        for &fact in facts {
            let is_coupled = self.records[fact].cluster.is_some();
            let is_open = is_coupled || {
                let p = self.independent_probability(model, fact);
                p > 0.0 && p < 1.0
            };
            if is_open {
                open.push(fact);
            }
        }
        open
    }

    /// Returns the truth value of a basic fact; those of a cluster are the bits of `index`.
    ///
    /// Independent facts must be certain.
    pub(super) fn is_true(
        &self,
        model: &Model,
        fact: FactId,
        coupled: &[usize],
        index: usize,
    ) -> bool {
        let Some(position) = model.position(fact) else {
            return false;
        };
        match coupled.iter().position(|&own| own == position) {
            Some(place) => index & (1 << place) != 0,
            None => self.records[position].p > 0.5,
        }
    }

    /// Puts facts into one cluster, with all facts that they are already coupled to.
    pub(super) fn couple(&mut self, model: &Model, facts: &[usize]) -> Result<u32, usize> {
        let mut slots: Vec<u32> = Vec::new();
        let mut singles: Vec<usize> = Vec::new();
        for &fact in facts {
            match self.records[fact].cluster {
                Some(slot) if !slots.contains(&slot) => slots.push(slot),
                Some(_) => {}
                None => singles.push(fact),
            }
        }
        let in_clusters = slots
            .iter()
            .map(|&slot| self.cluster(model, slot).facts.len());
        let count = in_clusters.sum::<usize>() + singles.len();
        if count > MAX_COUPLED {
            return Err(count);
        }
        if let ([slot], []) = (slots.as_slice(), singles.as_slice()) {
            return Ok(*slot);
        }
        let mut merged = Cluster::unit(self.layer);
        for slot in slots {
            self.cluster(model, slot);
            if let Some(part) = self.clusters[slot as usize].clone() {
                merged.extend(&part.facts, &part.weights);
            }
            self.set_cluster(slot, None);
        }
        for fact in singles {
            let p = self.independent_probability(model, fact);
            merged.extend(&[fact], &[1.0 - p, p]);
        }
        let slot = u32::try_from(self.clusters.len()).expect("few clusters");
        for &fact in &merged.facts {
            self.put_record(
                fact,
                Record {
                    layer: self.layer,
                    p: f64::NAN,
                    cluster: Some(slot),
                },
            );
        }
        self.clusters.push(Some(merged));
        Ok(slot)
    }

    /// Removes facts that have become certain from the cluster.
    pub(super) fn release_certain(&mut self, slot: u32) {
        let Some(mut cluster) = self.clusters[slot as usize].clone() else {
            return;
        };
        let mut is_changed = false;
        for &fact in &cluster.facts.clone() {
            let place = cluster.place(fact);
            let p = cluster.marginal(place);
            let bit = 1 << place;
            let is_false = cluster.mass(|index| index & bit != 0) == 0.0;
            let is_true = cluster.mass(|index| index & bit == 0) == 0.0;
            if is_false || is_true || cluster.facts.len() == 1 {
                cluster.remove(place);
                let p = if is_false {
                    0.0
                } else if is_true {
                    1.0
                } else {
                    p
                };
                let record = Record {
                    layer: cluster.layer,
                    p,
                    cluster: None,
                };
                self.put_record(fact, record);
                is_changed = true;
            }
        }
        if is_changed {
            let rest = (!cluster.facts.is_empty()).then_some(cluster);
            self.set_cluster(slot, rest);
        }
    }

    /// Removes a fact from its cluster, if it is in one. Its probability is `p` from the present
    /// layer on.
    pub(super) fn split_off(&mut self, fact: usize, p: f64) {
        let record = Record {
            layer: self.layer,
            p,
            cluster: None,
        };
        if let Some(slot) = self.records[fact].cluster
            && let Some(mut cluster) = self.clusters[slot as usize].clone()
        {
            cluster.remove(cluster.place(fact));
            let rest = (!cluster.facts.is_empty()).then_some(cluster);
            self.set_cluster(slot, rest);
        }
        self.put_record(fact, record);
    }

    /// Removes a fact from its cluster, for a fact whose value no longer depends on its past. Its
    /// probability is `p` from the layer `next` on.
    pub(super) fn decouple(&mut self, model: &Model, fact: usize, p: f64, next: u32) {
        if let Some(slot) = self.records[fact].cluster {
            self.cluster(model, slot);
        }
        self.split_off(fact, p);
        self.set_record_at(fact, p, next);
    }

    /// Returns a cluster, updated to the present layer.
    pub(super) fn cluster(&mut self, model: &Model, slot: u32) -> &Cluster {
        let layer = self.layer;
        let is_behind = |cluster: &Cluster| cluster.layer < layer;
        if let Some(mut cluster) = self.clusters[slot as usize].clone().filter(is_behind) {
            for transition in &self.transitions[cluster.layer as usize..layer as usize] {
                for place in 0..cluster.facts.len() {
                    let fact = cluster.facts[place];
                    cluster.transform(
                        place,
                        match transition {
                            None => spontaneous_kernel(model.spontaneous_changes[fact]),
                            Some(seconds) => rate_kernel(model.rates[fact], *seconds),
                        },
                    );
                }
            }
            cluster.layer = layer;
            self.set_cluster(slot, Some(cluster));
        }
        let cluster = self.clusters[slot as usize].as_ref();
        cluster.expect("facts refer to clusters that are there")
    }
}
