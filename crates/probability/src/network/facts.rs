//! Joint distribution of the facts, given that all happenings until now succeeded.
//!
//! Facts are independent of each other until a condition couples them. So the distribution is a
//! product: one number for each independent fact, and one [`Cluster`] for each group of coupled
//! facts. Facts change by themselves with every layer. These changes are applied lazily, when a
//! fact is accessed.

mod coupling;
mod snapshot;

use elbowroom_model::ground::{Condition, Expression, FactId};

use super::cluster::{Cluster, Kernel};
use super::outcome::{Outcome, Pending, kernel, rate_kernel, spontaneous_kernel};
use crate::belief::Belief;
use crate::likelihoods::Rate;
use crate::model::{Model, Value, evaluate, visit_facts};

pub(crate) use snapshot::Snapshot;

/// Largest number of facts in a cluster (2^16 numbers).
pub(super) const MAX_COUPLED: usize = 16;

/// Belief about a fact.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Record {
    /// Layer of `p`. A coupled fact's cluster has its own layer.
    layer: u32,
    /// P(true), for an independent fact.
    p: f64,
    /// The fact's cluster, if it is coupled.
    cluster: Option<u32>,
}

/// Joint distribution of the facts.
#[derive(Clone, Debug)]
pub(super) struct Facts {
    layer: u32,
    /// By layer, the transition to the next one: a step, or the elapsed seconds.
    transitions: Vec<Option<f64>>,
    records: Vec<Record>,
    clusters: Vec<Option<Cluster>>,
    undo: Vec<Undo>,
}

#[derive(Clone, Debug)]
enum Undo {
    Record(usize, Record),
    Cluster(usize, Option<Cluster>),
}

/// A state to return to.
#[derive(Clone, Copy, Debug)]
pub(super) struct Checkpoint {
    layer: u32,
    undo: usize,
    clusters: usize,
}

impl Facts {
    pub(super) fn new(model: &Model, belief: &Belief) -> Self {
        let record = |&fact: &FactId| Record {
            layer: 0,
            p: belief.probability(fact),
            cluster: None,
        };
        Self {
            layer: 0,
            transitions: Vec::new(),
            records: model.facts.iter().map(record).collect(),
            clusters: Vec::new(),
            undo: Vec::new(),
        }
    }

    pub(super) fn checkpoint(&self) -> Checkpoint {
        Checkpoint {
            layer: self.layer,
            undo: self.undo.len(),
            clusters: self.clusters.len(),
        }
    }

    pub(super) fn undo_to(&mut self, checkpoint: Checkpoint) {
        while self.undo.len() > checkpoint.undo {
            match self.undo.pop() {
                Some(Undo::Record(fact, record)) => self.records[fact] = record,
                Some(Undo::Cluster(slot, cluster)) => self.clusters[slot] = cluster,
                None => {}
            }
        }
        self.clusters.truncate(checkpoint.clusters);
        self.layer = checkpoint.layer;
        self.transitions.truncate(checkpoint.layer as usize);
    }

    /// Makes a fact certain before any happening.
    pub(super) fn set_certain(&mut self, fact: usize, truth: bool) {
        self.records[fact].p = f64::from(u8::from(truth));
    }

    /// Makes a fact certain in the present layer.
    pub(super) fn set_certain_later(&mut self, fact: usize, truth: bool) {
        self.split_off(fact, f64::from(u8::from(truth)));
    }

    /// Returns P(true) in the present layer.
    pub(super) fn marginal(&mut self, model: &Model, fact: usize) -> f64 {
        match self.records[fact].cluster {
            None => self.independent_probability(model, fact),
            Some(slot) => {
                let cluster = self.cluster(model, slot);
                cluster.marginal(cluster.place(fact))
            }
        }
    }

    /// Conditions on the fact's truth value, and returns its probability.
    pub(super) fn require(&mut self, model: &Model, fact: usize, truth: bool) -> f64 {
        if let Some(slot) = self.records[fact].cluster {
            return self.require_in_cluster(model, slot, fact, truth);
        }
        let p = self.independent_probability(model, fact);
        let mass = if truth { p } else { 1.0 - p };
        self.set_record(fact, f64::from(u8::from(truth)));
        mass
    }

    fn require_in_cluster(&mut self, model: &Model, slot: u32, fact: usize, truth: bool) -> f64 {
        let mut cluster = self.cluster(model, slot).clone();
        let bit = 1 << cluster.place(fact);
        let mass = cluster.condition(|index| (index & bit != 0) == truth);
        self.set_cluster(slot, Some(cluster));
        self.release_certain(slot);
        mass
    }

    /// Conditions on a condition that reads several facts. Returns its probability, and `true` if
    /// parts of it had to be assumed. Returns the number of facts as an error if they cannot be
    /// coupled.
    pub(super) fn require_coupled(
        &mut self,
        model: &Model,
        condition: &Condition,
        facts: &[usize],
        value: &dyn Fn(&Expression) -> Value,
    ) -> Result<(f64, bool), usize> {
        let mut rests_on_time = false;
        let open = self.open(model, facts);
        if open.is_empty() {
            let truth = |fact| self.is_true(model, fact, &[], 0);
            let holds = evaluate(model.task(), condition, &truth, value);
            return Ok(match holds {
                Ok(holds) => (f64::from(u8::from(holds)), false),
                Err(_) => (1.0, true),
            });
        }
        let slot = self.couple(model, &open)?;
        let mut cluster = self.cluster(model, slot).clone();
        let coupled = cluster.facts.clone();
        let mass = cluster.condition(|index| {
            let truth = |fact| self.is_true(model, fact, &coupled, index);
            evaluate(model.task(), condition, &truth, value).unwrap_or_else(|_| {
                rests_on_time = true;
                true
            })
        });
        self.set_cluster(slot, Some(cluster));
        self.release_certain(slot);
        Ok((mass, rests_on_time))
    }

    /// Returns the truth value of a condition if it is the same in all possible cases.
    pub(super) fn truth(
        &mut self,
        model: &Model,
        condition: &Condition,
        value: &dyn Fn(&Expression) -> Value,
    ) -> Option<bool> {
        let facts = read(model, condition);
        if self.open(model, &facts).is_empty() {
            let truth = |fact| self.is_true(model, fact, &[], 0);
            evaluate(model.task(), condition, &truth, value).ok()
        } else {
            None
        }
    }

    /// Applies unconditional effects, sorted by fact, and spontaneous changes.
    pub(super) fn apply(&mut self, model: &Model, outcomes: &[Outcome], is_step: bool) {
        let next = self.layer + u32::from(is_step);
        // Facts that stay coupled, by cluster, because all facts of a cluster change at once.
        let mut coupled: Vec<(u32, Vec<(usize, Kernel)>)> = Vec::new();
        for of_one in outcomes.chunk_by(|a, b| a.fact == b.fact) {
            let fact = of_one[0].fact;
            let kernel = kernel(model, fact, of_one.iter(), is_step);
            let forgets = (kernel.if_true - kernel.if_false).abs() == 0.0;
            match self.records[fact].cluster {
                Some(slot) if !forgets => {
                    match coupled.iter_mut().find(|(other, _)| *other == slot) {
                        Some((_, kernels)) => kernels.push((fact, kernel)),
                        None => coupled.push((slot, vec![(fact, kernel)])),
                    }
                }
                Some(_) => self.decouple(model, fact, kernel.if_true, next),
                None => {
                    let p = kernel.apply(self.independent_probability(model, fact));
                    self.set_record_at(fact, p, next);
                }
            }
        }
        for (slot, kernels) in coupled {
            let mut cluster = self.cluster(model, slot).clone();
            for (place, &fact) in cluster.facts.clone().iter().enumerate() {
                match kernels.iter().find(|(changed, _)| *changed == fact) {
                    Some((_, kernel)) => cluster.transform(place, *kernel),
                    None if is_step => cluster
                        .transform(place, spontaneous_kernel(model.spontaneous_changes[fact])),
                    None => {}
                }
            }
            cluster.layer = next;
            self.set_cluster(slot, Some(cluster));
        }
        if is_step {
            self.transitions.push(None);
        }
        self.layer = next;
    }

    /// Lets time pass: facts change by themselves, except for those in `held`, which keep their
    /// values.
    pub(super) fn advance(&mut self, seconds: f64, held: &[(usize, bool)]) {
        self.transitions.push(Some(seconds));
        self.layer += 1;
        for &(fact, truth) in held {
            self.set_certain_later(fact, truth);
        }
    }

    /// Applies guarded effects with uncertain guards, together with all other changes. Returns the
    /// number of facts as an error if they cannot be coupled.
    pub(super) fn apply_guarded(
        &mut self,
        model: &Model,
        guarded: &[(Option<Condition>, Outcome)],
        pending: &Pending,
        value: &dyn Fn(&Expression) -> Value,
    ) -> Result<(), usize> {
        let mut involved: Vec<usize> = Vec::new();
        for (guard, outcome) in guarded {
            if let Some(guard) = guard {
                let facts = read(model, guard);
                involved.extend(self.open(model, &facts));
            }
            involved.push(outcome.fact);
        }
        // Changed facts are included even if they are certain and independent.
        involved.sort_unstable();
        involved.dedup();
        let slot = self.couple(model, &involved)?;
        let mut cluster = self.cluster(model, slot).clone();
        let coupled = cluster.facts.clone();
        let mut places: Vec<usize> = Vec::new();
        let all = guarded.iter().map(|(_, outcome)| outcome);
        for outcome in all.chain(&pending.independent) {
            if let Some(place) = coupled.iter().position(|&fact| fact == outcome.fact)
                && !places.contains(&place)
            {
                places.push(place);
            }
        }
        cluster.transform_jointly(&places, |before| {
            let truth = |fact| self.is_true(model, fact, &coupled, before);
            let takes_place = |guard: &Option<Condition>| match guard {
                None => true,
                Some(guard) => evaluate(model.task(), guard, &truth, value).unwrap_or(false),
            };
            let happening: Vec<Outcome> = guarded
                .iter()
                .filter(|(guard, _)| takes_place(guard))
                .map(|(_, outcome)| *outcome)
                .chain(pending.independent.iter().copied())
                .collect();
            let of = |&place: &usize| {
                let fact = coupled[place];
                let own = happening.iter().filter(move |outcome| outcome.fact == fact);
                kernel(model, fact, own, pending.is_step)
            };
            places.iter().map(of).collect()
        });
        if pending.is_step {
            for (place, &fact) in coupled.iter().enumerate() {
                if !places.contains(&place) {
                    cluster.transform(place, spontaneous_kernel(model.spontaneous_changes[fact]));
                }
            }
            cluster.layer += 1;
        }
        self.set_cluster(slot, Some(cluster));
        let apart: Vec<Outcome> = pending
            .independent
            .iter()
            .filter(|outcome| !coupled.contains(&outcome.fact))
            .copied()
            .collect();
        self.apply(model, &apart, pending.is_step);
        self.release_certain(slot);
        Ok(())
    }

    /// Returns P(true) of an independent fact, updated to the present layer.
    fn independent_probability(&mut self, model: &Model, fact: usize) -> f64 {
        let record = self.records[fact];
        if record.layer >= self.layer {
            return record.p;
        }
        let (flip, rate) = (model.spontaneous_changes[fact], model.rates[fact]);
        let mut p = record.p;
        for transition in &self.transitions[record.layer as usize..self.layer as usize] {
            p = match transition {
                None => flip.after(p),
                Some(_) if rate == Rate::NEVER => p,
                Some(seconds) => rate_kernel(rate, *seconds).apply(p),
            };
        }
        self.set_record(fact, p);
        p
    }

    fn set_record(&mut self, fact: usize, p: f64) {
        self.set_record_at(fact, p, self.layer);
    }

    fn set_record_at(&mut self, fact: usize, p: f64, layer: u32) {
        let record = Record {
            layer,
            p,
            cluster: None,
        };
        self.put_record(fact, record);
    }

    fn put_record(&mut self, fact: usize, record: Record) {
        let old = std::mem::replace(&mut self.records[fact], record);
        self.undo.push(Undo::Record(fact, old));
    }

    fn set_cluster(&mut self, slot: u32, cluster: Option<Cluster>) {
        let old = std::mem::replace(&mut self.clusters[slot as usize], cluster);
        self.undo.push(Undo::Cluster(slot as usize, old));
    }
}

/// Returns the basic facts and memories that a condition reads.
fn read(model: &Model, condition: &Condition) -> Vec<usize> {
    let mut facts = Vec::new();
    visit_facts(model.task(), condition, &mut |fact| {
        facts.extend(model.position(fact));
    });
    facts.sort_unstable();
    facts.dedup();
    facts
}
