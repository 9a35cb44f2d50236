//! The world as the authors' programs made it: [`PublishedWorld`].

use std::collections::{BTreeMap, BTreeSet};

use crate::untimed::UntimedWorld;
use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::problem::{ObjectId, PredicateId, SchemaId};
use elbowroom_model::{State, Task};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::chances::{Chances, EffectChance};
use super::rand_c::RandC;
use elbowroom_sim::draw::{Purpose, keyed};

/// What changes by itself in a [`PublishedWorld`]: the authors' program knows two predicates, of
/// one argument each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Perturbation {
    /// Facts that come and go: `machine_is_maintained`.
    pub achieved: PredicateId,
    /// Facts that go and never come back: `machine_is_working`.
    pub needed: PredicateId,
}

/// The published experiments' world, with the artefacts that its results depend on:
///
/// - Whether starts and effects succeed comes from `rand()`, never seeded: it is the same in all
///   trials. One sequence is for the starts, and one for the effects of each schema.
/// - Of all facts only those of [`Perturbation`] change by themselves. What is needed is lost only
///   while it is not achieved; every object is drawn for twice (the lists of them are filled
///   twice), and for each of its facts but those achieved; each such draw is first for losing what
///   is needed, and otherwise for achieving.
/// - Only one fact changes each time: the first change drawn says which, and the last one drawn
///   says whether it comes or goes, whatever that last change was about.
/// - Whether a message starts or ends an action is known by counting: an action that was given up
///   after its start has its end effects when it is started again.
///
/// Only the changes by themselves depend on the seed.
#[derive(Clone, Debug)]
pub struct PublishedWorld<'a> {
    chances: &'a Chances,
    perturbed: &'a PerturbedFacts,
    state: State,
    /// The true facts, in the order in which they became true.
    facts: Vec<FactId>,
    starts: RandC,
    effects: BTreeMap<SchemaId, RandC>,
    started: BTreeSet<(SchemaId, Vec<ObjectId>)>,
    changes: ChaCha8Rng,
}

/// A [`Perturbation`] of the facts of a task.
#[derive(Clone, Debug)]
pub struct PerturbedFacts {
    /// By fact: its first object, and whether it is achieved.
    of_fact: Vec<Option<(ObjectId, bool)>>,
    /// By object.
    achieved: BTreeMap<ObjectId, (FactId, f64, f64)>,
    needed: BTreeMap<ObjectId, (FactId, f64)>,
    initial: Vec<FactId>,
}

impl Perturbation {
    /// Which facts it concerns, and how likely they are to change.
    pub fn facts(self, task: &Task, chances: &Chances) -> PerturbedFacts {
        let count = u32::try_from(task.fact_count()).unwrap_or(u32::MAX);
        let atom = |fact| {
            let (predicate, arguments) = task.atom(fact);
            let object = arguments.first().copied();
            object.map(|object| (object, predicate == self.achieved))
        };
        let mut facts = PerturbedFacts {
            of_fact: (0..count).map(FactId).map(atom).collect(),
            achieved: BTreeMap::new(),
            needed: BTreeMap::new(),
            initial: Vec::new(),
        };
        for &(fact, flip) in &chances.flips {
            let (predicate, arguments) = task.atom(fact);
            let [object] = *arguments else { continue };
            if predicate == self.achieved {
                let rates = (fact, flip.becomes_true, flip.becomes_false);
                facts.achieved.insert(object, rates);
            } else if predicate == self.needed {
                facts.needed.insert(object, (fact, flip.becomes_false));
            }
        }
        let initial = &task.problem().initial_facts;
        facts.initial = initial
            .iter()
            .filter_map(|(predicate, arguments)| task.find_fact(*predicate, arguments))
            .filter(|fact| task.initial().facts.contains(fact))
            .collect();
        facts
    }
}

impl<'a> PublishedWorld<'a> {
    /// The world of that seed, at the beginning.
    pub fn new(chances: &'a Chances, perturbed: &'a PerturbedFacts, seed: u64) -> Self {
        let facts = perturbed.initial.clone();
        Self {
            chances,
            perturbed,
            state: State {
                facts: facts.iter().copied().collect(),
                ..State::default()
            },
            facts,
            starts: RandC::unseeded(),
            effects: BTreeMap::new(),
            started: BTreeSet::new(),
            changes: keyed(seed, "", 0, Purpose::Change),
        }
    }

    fn set(&mut self, fact: FactId, truth: bool) {
        if !truth {
            self.facts.retain(|&other| other != fact);
            self.state.facts.remove(&fact);
        } else if self.state.facts.insert(fact) {
            self.facts.push(fact);
        }
    }

    /// The simulated action hears of its start or its end, and takes it for what is next.
    fn message(&mut self, action: &Action) {
        let chances = self.chances;
        let Some(chances) = chances.of(action) else {
            return;
        };
        let key = (action.schema, action.arguments.clone());
        let effects: &[EffectChance] = if self.started.remove(&key) {
            &chances.end_effects
        } else {
            if action.durative().is_some() {
                self.started.insert(key);
            }
            &chances.start_effects
        };
        for effect in effects {
            let rand = self.effects.entry(action.schema);
            let draw = rand.or_insert_with(RandC::unseeded).share();
            if draw <= effect.probability {
                self.set(effect.fact, effect.makes_true);
            }
        }
    }

    fn perturb(&mut self) {
        let mut achieved = Vec::new();
        let mut others = Vec::new();
        for fact in &self.facts {
            match self.perturbed.of_fact[fact.index()] {
                Some((object, true)) => achieved.push(object),
                Some((object, false)) => others.push(object),
                None => {}
            }
        }
        // The first change drawn, and whether the last one drawn adds or removes.
        let mut change: Option<(FactId, bool)> = None;
        let mut drawn = |fact: FactId, truth: bool| {
            change = Some((change.map_or(fact, |(first, _)| first), truth));
        };
        for object in achieved.iter().chain(&achieved) {
            if let Some(&(fact, _, lost)) = self.perturbed.achieved.get(object)
                && self.changes.random::<f64>() < lost
            {
                drawn(fact, false);
            }
        }
        for object in others.iter().chain(&others) {
            if achieved.contains(object) {
                continue;
            }
            if let Some(&(fact, lost)) = self.perturbed.needed.get(object)
                && self.changes.random::<f64>() < lost
            {
                drawn(fact, false);
            } else if let Some(&(fact, comes, _)) = self.perturbed.achieved.get(object)
                && self.changes.random::<f64>() < comes
            {
                drawn(fact, true);
            }
        }
        if let Some((fact, truth)) = change {
            self.set(fact, truth);
        }
    }
}

impl UntimedWorld for PublishedWorld<'_> {
    fn state(&self) -> &State {
        &self.state
    }

    fn attempt(&mut self, action: &Action) -> bool {
        let chances = self.chances.of(action);
        let draw = self.starts.share();
        let has_started = chances.is_some_and(|chances| draw <= chances.start);
        if has_started {
            self.message(action);
        }
        self.perturb();
        has_started
    }

    fn end(&mut self, action: &Action) -> bool {
        self.message(action);
        self.perturb();
        // In the authors' program ends do not fail.
        true
    }
}
