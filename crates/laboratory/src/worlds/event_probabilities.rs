//! Likelihoods of a task's facts and actions, prepared for sampling: [`EventProbabilities`].

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Body, Change, FactId, SnapAction};
use elbowroom_model::problem::{ObjectId, SchemaId};
use elbowroom_probability::likelihoods::{FailureOutcome, Missing};
use elbowroom_probability::{Likelihoods, SpontaneousChange};

/// Random events of a perturbed world, with their probabilities.
#[derive(Clone, Debug)]
pub struct EventProbabilities {
    /// Spontaneous changes of each fact.
    pub(super) flips: Vec<(FactId, SpontaneousChange)>,
    actions: BTreeMap<(SchemaId, Vec<ObjectId>), ActionProbabilities>,
}

#[derive(Clone, Debug)]
pub(super) struct ActionProbabilities {
    /// Probability that an attempt to start succeeds.
    pub(super) start: f64,
    pub(super) start_effects: Vec<EffectProbability>,
    pub(super) end_effects: Vec<EffectProbability>,
    /// Probability that the end succeeds.
    pub(super) end: f64,
    /// Outcomes of a failed end.
    pub(super) aftermaths: Vec<FailureOutcome>,
}

/// Effect with its probability. In lists, deletions come first.
#[derive(Clone, Copy, Debug)]
pub(super) struct EffectProbability {
    pub(super) fact: FactId,
    pub(super) makes_true: bool,
    pub(super) probability: f64,
}

impl EventProbabilities {
    /// Computes the chances of all facts of the task and of these actions.
    ///
    /// A fact that is neither changed by an action nor mentioned by the likelihoods never changes.
    ///
    /// # Errors
    /// A likelihood that is needed is missing.
    pub fn new(
        task: &Task,
        actions: &[Action],
        likelihoods: &Likelihoods,
    ) -> Result<Self, Missing> {
        let mut changed = BTreeSet::new();
        let mut chances = BTreeMap::new();
        for action in actions {
            let effects = |snap: &SnapAction| effects(task, action, snap, likelihoods);
            let (start_effects, end_effects) = match &action.body {
                Body::Instantaneous(snap) => (effects(snap)?, Vec::new()),
                Body::Durative(body) => (effects(&body.start)?, effects(&body.end)?),
            };
            let all = start_effects.iter().chain(&end_effects);
            changed.extend(all.map(|effect| task.atom(effect.fact).0));
            let start = likelihoods.start(action)?;
            chances.insert(
                (action.schema, action.arguments.clone()),
                ActionProbabilities {
                    start,
                    start_effects,
                    end_effects,
                    end: likelihoods.end(action),
                    aftermaths: likelihoods.failure_outcomes(task, action),
                },
            );
        }
        let mut flips = Vec::new();
        let count = u32::try_from(task.fact_count()).unwrap_or(u32::MAX);
        for fact in (0..count).map(FactId) {
            let (predicate, arguments) = task.atom(fact);
            let named = (predicate, arguments.clone());
            let is_mentioned = likelihoods.predicates.contains_key(&predicate)
                || likelihoods.facts.contains_key(&named);
            if is_mentioned || changed.contains(&predicate) {
                flips.push((fact, likelihoods.spontaneous_change(task, fact)?));
            }
        }
        Ok(Self {
            flips,
            actions: chances,
        })
    }

    /// Returns the probabilities of an action, or `None` if it was not passed to
    /// [`EventProbabilities::new`]. Such an action never starts.
    pub(super) fn of(&self, action: &Action) -> Option<&ActionProbabilities> {
        self.actions.get(&(action.schema, action.arguments.clone()))
    }
}

fn effects(
    task: &Task,
    action: &Action,
    snap: &SnapAction,
    likelihoods: &Likelihoods,
) -> Result<Vec<EffectProbability>, Missing> {
    let change = |effect: &elbowroom_model::ground::Effect| match effect.change {
        Change::Delete(fact) => Some((false, fact)),
        Change::Add(fact) => Some((true, fact)),
        Change::Update { .. } => None,
    };
    let mut changes: Vec<_> = snap.effects.iter().filter_map(change).collect();
    // A stable sort, which keeps the order of the domain otherwise.
    changes.sort_by_key(|(makes_true, _)| *makes_true);
    let with_likelihood = |(makes_true, fact): (bool, FactId)| {
        Ok(EffectProbability {
            fact,
            makes_true,
            probability: likelihoods.effect(task, action, fact, makes_true)?,
        })
    };
    changes.into_iter().map(with_likelihood).collect()
}
