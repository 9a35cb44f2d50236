//! World of the authors' programs: [`PublishedWorld`].

use std::collections::{BTreeMap, BTreeSet};

use crate::untimed::UntimedWorld;
use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::problem::{ObjectId, PredicateId, SchemaId};
use elbowroom_model::{State, Task};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::event_probabilities::{EffectProbability, EventProbabilities};
use super::rand_c::RandC;
use elbowroom_sim::draw::{Purpose, keyed};

/// Predicates of the spontaneous changes in a [`PublishedWorld`]. The authors' program has two,
/// with one argument each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Perturbation {
    /// Facts that may become true and false: `machine_is_maintained`.
    pub achieved: PredicateId,
    /// Facts that may only become false: `machine_is_working`.
    pub needed: PredicateId,
}

/// World of the published experiments, with the artefacts on which its results depend:
///
/// - Starts and effects succeed by `rand()`, which is never seeded: the values are the same in all
///   trials. There is one sequence for the starts, and one for the effects of each schema.
/// - Only the facts of [`Perturbation`] change spontaneously. A needed fact is lost only while it
///   is not achieved. Every object is drawn twice (its lists are filled twice), and once for each
///   of its facts other than those achieved. Each such draw first decides the loss of the needed
///   fact, and otherwise the achievement.
/// - Only one fact changes each time. The first drawn change selects the fact, and the last drawn
///   change decides whether it becomes true or false, even if it is about another fact.
/// - Messages are counted to find out whether they start or end an action. So if an action was
///   abandoned after its start, the next start of it counts as its end and has the end effects.
///
/// Only the spontaneous changes depend on the seed.
#[derive(Clone, Debug)]
pub struct PublishedWorld<'a> {
    chances: &'a EventProbabilities,
    perturbed: &'a PerturbedFacts,
    state: State,
    /// True facts, in the order in which they became true.
    facts: Vec<FactId>,
    starts: RandC,
    effects: BTreeMap<SchemaId, RandC>,
    started: BTreeSet<(SchemaId, Vec<ObjectId>)>,
    changes: ChaCha8Rng,
}

/// [`Perturbation`] of the facts of a task.
#[derive(Clone, Debug)]
pub struct PerturbedFacts {
    /// By fact: its first object, and `true` if it is an achieved fact.
    of_fact: Vec<Option<(ObjectId, bool)>>,
    /// By object.
    achieved: BTreeMap<ObjectId, (FactId, f64, f64)>,
    needed: BTreeMap<ObjectId, (FactId, f64)>,
    initial: Vec<FactId>,
}

impl Perturbation {
    /// Returns the facts concerned, with the probabilities of their changes.
    pub fn facts(self, task: &Task, chances: &EventProbabilities) -> PerturbedFacts {
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
    /// Creates the world of that seed.
    pub fn new(chances: &'a EventProbabilities, perturbed: &'a PerturbedFacts, seed: u64) -> Self {
        let facts = perturbed.initial.clone();
        Self {
            chances,
            perturbed,
            state: State {
                facts: facts.iter().copied().collect(),
                ..State::default()
            },
            facts,
            starts: RandC::with_default_seed(),
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

    /// Delivers a start or end message to the simulated action, which takes it for the one that is
    /// due.
    fn message(&mut self, action: &Action) {
        let chances = self.chances;
        let Some(chances) = chances.of(action) else {
            return;
        };
        let key = (action.schema, action.arguments.clone());
        let effects: &[EffectProbability] = if self.started.remove(&key) {
            &chances.end_effects
        } else {
            if action.durative().is_some() {
                self.started.insert(key);
            }
            &chances.start_effects
        };
        for effect in effects {
            let rand = self.effects.entry(action.schema);
            let draw = rand.or_insert_with(RandC::with_default_seed).share();
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
        // The fact of the first drawn change, and the truth value of the last one.
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
        // Ends do not fail in the authors' program.
        true
    }
}
