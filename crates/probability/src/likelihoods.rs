//! Probabilities of failures and spontaneous changes: [`Likelihoods`].

mod failure_model;
mod file;
mod names;
mod olisipo_format;
mod write;

use std::collections::BTreeMap;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, FactId};
use elbowroom_model::problem::{ObjectId, PredicateId, Problem, SchemaId};

use elbowroom_text::{Diagnostics, Source};

use crate::belief::Belief;

pub use failure_model::{Argument, FailureModel, FailureOutcome, Outcome, OutcomeChange};
pub use olisipo_format::read as read_authors;
pub use write::write;

/// Reads a likelihood file, in Elbowroom's format or in that of Olisipo's authors. The authors'
/// format is recognised by a line `-` between facts and actions, which cannot occur in the other
/// one.
///
/// # Errors
/// All mistakes found: syntax errors, unknown names, invalid numbers, and missing entries.
pub fn read(source: impl Into<Source>, task: &Task) -> Result<Likelihoods, Diagnostics> {
    let source = source.into();
    if source.text().lines().any(|line| line.trim() == "-") {
        olisipo_format::read(source, task)
    } else {
        file::read(source, task)
    }
}

/// Probabilities of a spontaneous change of a fact in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpontaneousChange {
    /// Probability that it becomes true, if it is false.
    pub becomes_true: f64,
    /// Probability that it becomes false, if it is true.
    pub becomes_false: f64,
}

impl SpontaneousChange {
    /// A fact that never changes by itself.
    pub const NEVER: Self = Self {
        becomes_true: 0.0,
        becomes_false: 0.0,
    };

    /// Returns the probability of being true one step later, if it is `p` now.
    pub fn after(self, p: f64) -> f64 {
        p * (1.0 - self.becomes_false) + (1.0 - p) * self.becomes_true
    }
}

/// Rates of spontaneous changes of a fact, per second, while it has the other value. The process
/// has no memory: the fact changes within the next `t` seconds with probability 1 − exp(−rate · t).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rate {
    /// Rate while it is false.
    pub becomes_true: f64,
    /// Rate while it is true.
    pub becomes_false: f64,
}

impl Rate {
    /// A fact that does not change with time.
    pub const NEVER: Self = Self {
        becomes_true: 0.0,
        becomes_false: 0.0,
    };

    /// Returns the probabilities of being true `seconds` later, if it is true now and if it is
    /// false now.
    pub fn probabilities_after(self, seconds: f64) -> (f64, f64) {
        let sum = self.becomes_true + self.becomes_false;
        if sum <= 0.0 {
            return (1.0, 0.0);
        }
        let changed = -(-sum * seconds).exp_m1();
        let in_the_end = self.becomes_true / sum;
        (1.0 - (1.0 - in_the_end) * changed, in_the_end * changed)
    }

    /// Returns the probability that it does not change for `seconds`.
    pub fn unchanged_probability(self, truth: bool, seconds: f64) -> f64 {
        let away = if truth {
            self.becomes_false
        } else {
            self.becomes_true
        };
        (-away * seconds).exp()
    }
}

/// Success probabilities of an action: its start, its effects, and the time after its start.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Success {
    /// Probability that an attempt to start it succeeds, if its conditions hold.
    pub start: Option<f64>,
    /// For each predicate, the probability that an effect on it takes place.
    pub effects: BTreeMap<PredicateId, f64>,
    /// The same for effects that make facts false, if it differs.
    pub deletions: BTreeMap<PredicateId, f64>,
    /// Failures after its start.
    pub failing: FailureModel,
}

/// Default probabilities, used without a more specific entry.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Defaults {
    /// For facts that are false.
    pub becomes_true: Option<f64>,
    /// For facts that are true.
    pub becomes_false: Option<f64>,
    /// For facts that are false, per second.
    pub becomes_true_per_second: Option<f64>,
    /// For facts that are true, per second.
    pub becomes_false_per_second: Option<f64>,
    /// For starts of actions.
    pub start: Option<f64>,
    /// For effects.
    pub effect: Option<f64>,
    /// For failures of actions after their start.
    pub failing: FailureModel,
}

/// Parts of a [`SpontaneousChange`] and of a [`Rate`] that an entry contains.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PartialChange {
    /// See [`SpontaneousChange::becomes_true`].
    pub becomes_true: Option<f64>,
    /// See [`SpontaneousChange::becomes_false`].
    pub becomes_false: Option<f64>,
    /// See [`Rate::becomes_true`].
    pub becomes_true_per_second: Option<f64>,
    /// See [`Rate::becomes_false`].
    pub becomes_false_per_second: Option<f64>,
}

impl PartialChange {
    /// Entry for facts that never change by themselves.
    pub(crate) const NEVER: Self = Self {
        becomes_true: Some(0.0),
        becomes_false: Some(0.0),
        becomes_true_per_second: Some(0.0),
        becomes_false_per_second: Some(0.0),
    };
}

/// Likelihoods: the probabilities of spontaneous changes, and of successful actions and effects.
///
/// An entry of one ground fact or action takes precedence over one of its predicate or schema, and
/// this one over the defaults.
///
/// Invariant: all probabilities are in [0, 1], and rates per second are finite and not negative.
/// The fields are public, so the caller is responsible for this.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Likelihoods {
    /// Defaults.
    pub defaults: Defaults,
    /// By predicate.
    pub predicates: BTreeMap<PredicateId, PartialChange>,
    /// By ground fact.
    pub facts: BTreeMap<(PredicateId, Vec<ObjectId>), PartialChange>,
    /// By schema.
    pub schemas: BTreeMap<SchemaId, Success>,
    /// By ground action.
    pub actions: BTreeMap<(SchemaId, Vec<ObjectId>), Success>,
    /// Probabilities of facts in the initial state, if they are uncertain.
    pub beliefs: BTreeMap<(PredicateId, Vec<ObjectId>), f64>,
}

/// A fact, an action or an effect of the problem has no likelihood.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the likelihoods have no entry for {what}; add one, or a default")]
pub struct Missing {
    /// A fact, an action, or an effect of an action.
    pub what: String,
}

impl Likelihoods {
    /// Returns the likelihoods of a world without failures.
    pub fn certain() -> Self {
        Self {
            defaults: Defaults {
                becomes_true: Some(0.0),
                becomes_false: Some(0.0),
                start: Some(1.0),
                effect: Some(1.0),
                ..Defaults::default()
            },
            ..Self::default()
        }
    }

    /// Returns the facts that are uncertain initially, with their probabilities.
    ///
    /// A fact that neither an action nor the goal mentions has no number in the task, and is
    /// irrelevant.
    pub fn uncertain_facts(&self, task: &Task) -> Vec<(FactId, f64)> {
        let known = self
            .beliefs
            .iter()
            .filter_map(|((predicate, arguments), p)| {
                Some((task.find_fact(*predicate, arguments)?, *p))
            });
        known.collect()
    }

    /// Returns the probabilities of a spontaneous change of a fact.
    ///
    /// # Errors
    /// When there is no entry.
    pub fn spontaneous_change(
        &self,
        task: &Task,
        fact: FactId,
    ) -> Result<SpontaneousChange, Missing> {
        let (predicate, arguments) = task.atom(fact);
        self.spontaneous_change_of(predicate, &arguments)
            .ok_or_else(|| Missing {
                what: task.fact_name(fact),
            })
    }

    pub(crate) fn spontaneous_change_of(
        &self,
        predicate: PredicateId,
        arguments: &[ObjectId],
    ) -> Option<SpontaneousChange> {
        let said = self.merged_entry(predicate, arguments);
        // With a rate per second, the probability per step is optional and defaults to 0.
        let by_time = |rate: Option<f64>| rate.map(|_| 0.0);
        let up = said.becomes_true.or(self.defaults.becomes_true);
        let down = said.becomes_false.or(self.defaults.becomes_false);
        let (up_by_time, down_by_time) = self.rates_of(said);
        Some(SpontaneousChange {
            becomes_true: up.or(by_time(up_by_time))?,
            becomes_false: down.or(by_time(down_by_time))?,
        })
    }

    /// Returns two flags: the fact may become true by itself, and it may become false by itself.
    pub(crate) fn may_change(
        &self,
        predicate: PredicateId,
        arguments: &[ObjectId],
    ) -> (bool, bool) {
        self.possible_changes(self.merged_entry(predicate, arguments))
    }

    /// Returns `true` if facts of the predicate without an entry of their own may change by themselves.
    pub(crate) fn may_change_any(&self, predicate: PredicateId) -> bool {
        let said = self.predicates.get(&predicate).copied();
        let (becomes_true, becomes_false) = self.possible_changes(said.unwrap_or_default());
        becomes_true || becomes_false
    }

    fn possible_changes(&self, said: PartialChange) -> (bool, bool) {
        let some = |p: Option<f64>| p.is_some_and(|p| p > 0.0);
        let (up, down) = self.rates_of(said);
        (
            some(said.becomes_true.or(self.defaults.becomes_true)) || some(up),
            some(said.becomes_false.or(self.defaults.becomes_false)) || some(down),
        )
    }

    /// Returns the rates of spontaneous changes of a fact, per second; 0 without an entry.
    pub fn rate(&self, task: &Task, fact: FactId) -> Rate {
        let (predicate, arguments) = task.atom(fact);
        let (up, down) = self.rates_of(self.merged_entry(predicate, &arguments));
        Rate {
            becomes_true: up.unwrap_or(0.0),
            becomes_false: down.unwrap_or(0.0),
        }
    }

    /// Returns `true` if facts may change with time, not only with steps, or actions may fail with
    /// time.
    pub fn has_rates(&self) -> bool {
        let some = |rate: Option<f64>| rate.is_some_and(|rate| rate > 0.0);
        let entries = self.predicates.values().chain(self.facts.values());
        let mut rates =
            entries.flat_map(|it| [it.becomes_true_per_second, it.becomes_false_per_second]);
        rates.any(some)
            || some(self.defaults.becomes_true_per_second)
            || some(self.defaults.becomes_false_per_second)
            || self.has_failures_during()
    }

    /// Returns `true` if actions may fail after their start.
    pub fn has_failures(&self) -> bool {
        self.has_failing_ends() || self.has_failures_during()
    }

    /// Returns the merged entries of a fact and of its predicate.
    fn merged_entry(&self, predicate: PredicateId, arguments: &[ObjectId]) -> PartialChange {
        let own = self.facts.get(&(predicate, arguments.to_vec())).copied();
        let own = own.unwrap_or_default();
        let all = self.predicates.get(&predicate).copied().unwrap_or_default();
        PartialChange {
            becomes_true: own.becomes_true.or(all.becomes_true),
            becomes_false: own.becomes_false.or(all.becomes_false),
            becomes_true_per_second: own.becomes_true_per_second.or(all.becomes_true_per_second),
            becomes_false_per_second: own
                .becomes_false_per_second
                .or(all.becomes_false_per_second),
        }
    }

    fn rates_of(&self, said: PartialChange) -> (Option<f64>, Option<f64>) {
        let defaults = &self.defaults;
        (
            said.becomes_true_per_second
                .or(defaults.becomes_true_per_second),
            said.becomes_false_per_second
                .or(defaults.becomes_false_per_second),
        )
    }

    /// Returns the probability that an attempt to start an action succeeds.
    ///
    /// # Errors
    /// When there is no entry.
    pub fn start(&self, action: &Action) -> Result<f64, Missing> {
        self.start_of(action.schema, &action.arguments)
            .ok_or_else(|| Missing {
                what: action.name.clone(),
            })
    }

    pub(crate) fn start_of(&self, schema: SchemaId, arguments: &[ObjectId]) -> Option<f64> {
        let own = self.success_of(schema, arguments);
        let all = self.schemas.get(&schema);
        own.and_then(|success| success.start)
            .or_else(|| all.and_then(|success| success.start))
            .or(self.defaults.start)
    }

    /// Returns the probability that an effect of an action on a fact takes place.
    ///
    /// # Errors
    /// When there is no entry.
    pub fn effect(
        &self,
        task: &Task,
        action: &Action,
        fact: FactId,
        makes_true: bool,
    ) -> Result<f64, Missing> {
        let (predicate, _) = task.atom(fact);
        self.effect_of(action.schema, &action.arguments, predicate, makes_true)
            .ok_or_else(|| Missing {
                what: format!("the effect of {} on {}", action.name, task.fact_name(fact)),
            })
    }

    pub(crate) fn effect_of(
        &self,
        schema: SchemaId,
        arguments: &[ObjectId],
        predicate: PredicateId,
        makes_true: bool,
    ) -> Option<f64> {
        let own = self.success_of(schema, arguments);
        let all = self.schemas.get(&schema);
        let stated = |success: &Success| {
            let deletion = success.deletions.get(&predicate).filter(|_| !makes_true);
            deletion.or(success.effects.get(&predicate)).copied()
        };
        own.and_then(stated)
            .or_else(|| all.and_then(stated))
            .or(self.defaults.effect)
    }

    /// Returns `true` if the entries are complete for all instances of a schema with these effects.
    fn is_complete_for(&self, schema: SchemaId, affected: &[(PredicateId, bool)]) -> bool {
        let none = Success::default();
        let all = self.schemas.get(&schema).unwrap_or(&none);
        let is_stated = |predicate: &PredicateId, makes_true: bool| {
            self.defaults.effect.is_some()
                || all.effects.contains_key(predicate)
                || (!makes_true && all.deletions.contains_key(predicate))
        };
        all.start.or(self.defaults.start).is_some()
            && affected
                .iter()
                .all(|(predicate, makes_true)| is_stated(predicate, *makes_true))
    }

    fn success_of(&self, schema: SchemaId, arguments: &[ObjectId]) -> Option<&Success> {
        self.actions.get(&(schema, arguments.to_vec()))
    }

    /// Returns the initial belief: the task's initial state, except for the facts that are
    /// uncertain by the likelihoods.
    pub fn initial_belief(&self, task: &Task) -> Belief {
        let mut belief = Belief::certain(task.initial());
        for ((predicate, arguments), probability) in &self.beliefs {
            // A fact that nothing mentions is irrelevant.
            if let Some(fact) = task.find_fact(*predicate, arguments) {
                belief.set(fact, *probability);
            }
        }
        belief
    }
}

/// Returns `true` if actions or timed initials can change facts of the predicate.
pub(crate) fn is_changed(problem: &Problem, predicate: PredicateId) -> bool {
    use elbowroom_model::problem::{Body, Change, Effect, TimedChange};
    let touches = |effect: &Effect| match &effect.change {
        Change::Add(atom) | Change::Delete(atom) => atom.predicate == predicate,
        Change::Update { .. } => false,
    };
    problem.schemas.iter().any(|schema| match &schema.body {
        Body::Instantaneous { effects, .. } => effects.iter().any(touches),
        Body::Durative {
            start_effects,
            end_effects,
            ..
        } => start_effects.iter().chain(end_effects).any(touches),
    }) || problem.timed.iter().any(|timed| match &timed.change {
        TimedChange::Add(changed, _) | TimedChange::Delete(changed, _) => *changed == predicate,
        TimedChange::Assign(..) => false,
    })
}
