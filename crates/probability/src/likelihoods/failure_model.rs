//! Failures of actions after their start, and their effects.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Change, FactId};
use elbowroom_model::problem::{ObjectId, PredicateId, Problem, SchemaId};

use super::Likelihoods;

/// Failures of an action after its start, as far as an entry contains them.
///
/// Failed attempts to start are not included: they change nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FailureModel {
    /// Probability that the end succeeds as a whole, if its conditions hold. Otherwise the action
    /// has failed, and has none of its end effects. Default: 1.
    pub end: Option<f64>,
    /// Rate of failures per second while the action is running: after `t` seconds it is still
    /// running with probability exp(−rate · t). Default: 0.
    pub during_per_second: Option<f64>,
    /// `true` if a failure undoes the effects of the start on facts. Default: `false`.
    pub undone: Option<bool>,
    /// Possible outcomes of a failure. With the remaining probability, a failure changes nothing
    /// more.
    pub outcomes: Option<Vec<Outcome>>,
}

/// A possible outcome of a failure of an action.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Probability, given that the action fails after its start.
    pub probability: f64,
    /// Changes in this order, after the effects of the start are undone.
    pub changes: Vec<OutcomeChange>,
}

/// A fact that a failure changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutcomeChange {
    /// The fact's predicate.
    pub predicate: PredicateId,
    /// Objects of the fact.
    pub arguments: Vec<Argument>,
    /// `true` if it becomes true.
    pub becomes: bool,
}

/// An object of a fact that a failure changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// A fixed object.
    Object(ObjectId),
    /// The action's argument for the parameter at this position.
    Parameter(usize),
}

/// Effects of a failure of a ground action.
#[derive(Clone, Debug, PartialEq)]
pub struct FailureOutcome {
    /// Probability, given that the action fails after its start.
    pub probability: f64,
    /// Facts that are set, in this order, with their new truth values.
    pub changes: Vec<(FactId, bool)>,
}

impl FailureModel {
    /// Returns `true` if the entry contains failures after the start.
    pub(super) fn has_failures(&self) -> bool {
        self.end.is_some() || self.during_per_second.is_some()
    }

    /// Returns `true` if the entry contains effects of failures.
    pub(super) fn has_failure_effects(&self) -> bool {
        self.undone == Some(true) || self.outcomes.is_some()
    }
}

impl Likelihoods {
    /// Returns the entries for an action, the most specific first.
    fn failing_of(
        &self,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> impl Iterator<Item = &FailureModel> {
        let own = self.success_of(schema, arguments);
        let all = self.schemas.get(&schema);
        let entries = own.into_iter().chain(all);
        entries
            .map(|success| &success.failing)
            .chain([&self.defaults.failing])
    }

    fn failing<T: Copy>(
        &self,
        action: &Action,
        part: impl Fn(&FailureModel) -> Option<T>,
    ) -> Option<T> {
        // An instantaneous action has no end.
        action.durative()?;
        self.failing_of(action.schema, &action.arguments)
            .find_map(part)
    }

    /// Returns the probability that the end of an action succeeds, if its conditions hold.
    pub fn end(&self, action: &Action) -> f64 {
        self.failing(action, |said| said.end).unwrap_or(1.0)
    }

    /// Returns the rate of failures of an action per second while it is running.
    pub fn failure_rate(&self, action: &Action) -> f64 {
        self.failing(action, |said| said.during_per_second)
            .unwrap_or(0.0)
    }

    /// Returns the probability that a started action succeeds, if it takes `seconds`.
    pub fn success_probability(&self, action: &Action, seconds: f64) -> f64 {
        self.end(action) * (-self.failure_rate(action) * seconds).exp()
    }

    /// Returns the possible outcomes of a failure of an action after its start. Their probabilities
    /// add up to 1.
    ///
    /// Unconditional effects of the start on facts are undone, whether or not they took place, as
    /// in simulated worlds. If the start both deletes and adds a fact, it counts as having made it
    /// true.
    pub fn failure_outcomes(&self, task: &Task, action: &Action) -> Vec<FailureOutcome> {
        let undone = if self.failing(action, |said| said.undone) == Some(true) {
            start_reversal(action)
        } else {
            Vec::new()
        };
        let mut entries = self.failing_of(action.schema, &action.arguments);
        let outcomes = entries.find_map(|said| said.outcomes.as_deref());
        let mut left = 1.0;
        let mut all = Vec::new();
        for outcome in outcomes.into_iter().flatten() {
            left -= outcome.probability;
            let own = outcome.changes.iter();
            let own = own.filter_map(|change| Some((change.fact(task, action)?, change.becomes)));
            all.push(FailureOutcome {
                probability: outcome.probability,
                changes: undone.iter().copied().chain(own).collect(),
            });
        }
        // Decimal fractions do not add up to exactly 1 in binary.
        if left > 1e-9 || all.is_empty() {
            all.push(FailureOutcome {
                probability: left,
                changes: undone,
            });
        }
        all
    }

    /// Returns the facts that failures of an action after its start set, each with its new truth value. Empty for an action
    /// that cannot fail after its start.
    pub fn failure_changes(&self, task: &Task, action: &Action) -> BTreeSet<(FactId, bool)> {
        if self.end(action) >= 1.0 && self.failure_rate(action) <= 0.0 {
            return BTreeSet::new();
        }
        let aftermaths = self.failure_outcomes(task, action).into_iter();
        aftermaths.flat_map(|aftermath| aftermath.changes).collect()
    }

    /// Returns `true` if some entry contains failing ends.
    pub fn has_failing_ends(&self) -> bool {
        let mut all = self.all_failing();
        all.any(|failing| failing.end.is_some_and(|end| end < 1.0))
    }

    /// Returns `true` if some entry contains failures of running actions.
    pub(super) fn has_failures_during(&self) -> bool {
        let mut all = self.all_failing();
        all.any(|failing| failing.during_per_second.is_some_and(|rate| rate > 0.0))
    }

    fn all_failing(&self) -> impl Iterator<Item = &FailureModel> {
        let entries = self.schemas.values().chain(self.actions.values());
        entries
            .map(|success| &success.failing)
            .chain([&self.defaults.failing])
    }
}

/// Returns the changes of facts that undo a start.
fn start_reversal(action: &Action) -> Vec<(FactId, bool)> {
    let start = action
        .durative()
        .map_or(&[][..], |body| &body.start.effects);
    let is_added = |fact| {
        let mut effects = start.iter();
        effects.any(|effect| effect.change == Change::Add(fact))
    };
    let unconditional = start.iter().filter(|effect| effect.guard.is_trivial());
    let undone = unconditional.filter_map(|effect| match effect.change {
        Change::Add(fact) => Some((fact, false)),
        Change::Delete(fact) if !is_added(fact) => Some((fact, true)),
        Change::Delete(_) | Change::Update { .. } => None,
    });
    undone.collect()
}

impl OutcomeChange {
    /// Returns the fact for a failure of this action; `None` if an object has the wrong type, so
    /// that the fact does not exist.
    fn fact(&self, task: &Task, action: &Action) -> Option<FactId> {
        let objects = self.arguments.iter().map(|argument| match argument {
            Argument::Object(object) => Some(*object),
            Argument::Parameter(place) => action.arguments.get(*place).copied(),
        });
        let objects: Vec<ObjectId> = objects.collect::<Option<_>>()?;
        let problem = task.problem();
        let name = &problem.predicates[self.predicate.index()].name;
        task.fact_named(&problem.apply_name(name, &objects))
    }

    /// Returns the notation of files: `(on ?box floor)`.
    pub(super) fn text(&self, problem: &Problem, schema: Option<SchemaId>) -> String {
        let parameters = schema.map(|schema| &problem.schemas[schema.index()].parameters);
        let mut text = format!("({}", problem.predicates[self.predicate.index()].name);
        for argument in &self.arguments {
            text.push(' ');
            text.push_str(match argument {
                Argument::Object(object) => &problem.objects[object.index()].name,
                Argument::Parameter(place) => parameters
                    .and_then(|parameters| parameters.get(*place))
                    .map_or("?", |parameter| &parameter.name),
            });
        }
        text.push(')');
        text
    }
}
