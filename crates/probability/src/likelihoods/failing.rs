//! Actions that fail after their start, and what such a failure leaves behind.

use std::collections::BTreeSet;

use elbowroom_model::Task;
use elbowroom_model::ground::{Action, Change, FactId};
use elbowroom_model::problem::{ObjectId, PredicateId, Problem, SchemaId};

use super::Likelihoods;

/// The failures of an action after its start, as far as an entry speaks of them.
///
/// Attempts to start that fail are another matter: they leave everything as it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Failing {
    /// The probability that the end succeeds as a whole, its conditions being true; otherwise the
    /// action has failed, and has none of its end effects. 1 where nobody says anything.
    pub end: Option<f64>,
    /// How often per second the action fails while it is under way: after `t` seconds it still
    /// goes on with probability exp(−rate · t). 0 where nobody says anything.
    pub during_per_second: Option<f64>,
    /// Whether a failure takes back what the start has done to facts. Not, where nobody says
    /// anything.
    pub undone: Option<bool>,
    /// What a failure may leave behind; what the probabilities leave of 1 is the failure that
    /// changes nothing more.
    pub outcomes: Option<Vec<Outcome>>,
}

/// One of the ways in which things may stand when an action has failed.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// How likely it is, given that the action fails after its start.
    pub probability: f64,
    /// What changes, in this order, after what is undone.
    pub changes: Vec<OutcomeChange>,
}

/// A fact that a failure changes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct OutcomeChange {
    /// The fact's predicate.
    pub predicate: PredicateId,
    /// Its objects.
    pub arguments: Vec<Argument>,
    /// Whether it becomes true.
    pub becomes: bool,
}

/// An object of a fact that a failure changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Argument {
    /// This one.
    Object(ObjectId),
    /// The one that the action has for the parameter at this place.
    Parameter(usize),
}

/// What a failure of a ground action leaves behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Aftermath {
    /// How likely it is, given that the action fails after its start.
    pub probability: f64,
    /// The facts that are set, in this order, and to what.
    pub changes: Vec<(FactId, bool)>,
}

impl Failing {
    /// Whether it says that the action can fail after its start.
    pub(super) fn has_failures(&self) -> bool {
        self.end.is_some() || self.during_per_second.is_some()
    }

    /// Whether it says what a failure leaves behind.
    pub(super) fn has_leftovers(&self) -> bool {
        self.undone == Some(true) || self.outcomes.is_some()
    }
}

impl Likelihoods {
    /// What the entries of an action say, the most specific first.
    fn failing_of(
        &self,
        schema: SchemaId,
        arguments: &[ObjectId],
    ) -> impl Iterator<Item = &Failing> {
        let own = self.success_of(schema, arguments);
        let all = self.schemas.get(&schema);
        let entries = own.into_iter().chain(all);
        entries
            .map(|success| &success.failing)
            .chain([&self.defaults.failing])
    }

    fn failing<T: Copy>(&self, action: &Action, part: impl Fn(&Failing) -> Option<T>) -> Option<T> {
        // What takes no time has no end.
        action.durative()?;
        self.failing_of(action.schema, &action.arguments)
            .find_map(part)
    }

    /// The probability that the end of an action succeeds, its conditions being true.
    pub fn end(&self, action: &Action) -> f64 {
        self.failing(action, |said| said.end).unwrap_or(1.0)
    }

    /// How often per second an action fails while it is under way.
    pub fn during(&self, action: &Action) -> f64 {
        self.failing(action, |said| said.during_per_second)
            .unwrap_or(0.0)
    }

    /// The probability that an action that has started succeeds, if it takes so many seconds.
    pub fn lasts(&self, action: &Action, seconds: f64) -> f64 {
        self.end(action) * (-self.during(action) * seconds).exp()
    }

    /// What a failure of an action after its start leaves behind: the ways in which things may
    /// stand then. Their probabilities add up to 1.
    ///
    /// Unconditional effects of the start on facts are undone, whether or not they took place, as
    /// in simulated worlds; where the start both deletes and adds a fact, it is taken to have made
    /// it true.
    pub fn aftermaths(&self, task: &Task, action: &Action) -> Vec<Aftermath> {
        let undone = if self.failing(action, |said| said.undone) == Some(true) {
            undone(action)
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
            all.push(Aftermath {
                probability: outcome.probability,
                changes: undone.iter().copied().chain(own).collect(),
            });
        }
        // Tenths do not add up to 1 in binary.
        if left > 1e-9 || all.is_empty() {
            all.push(Aftermath {
                probability: left,
                changes: undone,
            });
        }
        all
    }

    /// Returns the facts that failures of an action after its start set, each with its new truth value. Empty for an action
    /// that cannot fail after its start.
    pub fn failure_changes(&self, task: &Task, action: &Action) -> BTreeSet<(FactId, bool)> {
        if self.end(action) >= 1.0 && self.during(action) <= 0.0 {
            return BTreeSet::new();
        }
        let aftermaths = self.aftermaths(task, action).into_iter();
        aftermaths.flat_map(|aftermath| aftermath.changes).collect()
    }

    /// Whether an entry says that ends fail.
    pub fn has_failing_ends(&self) -> bool {
        let mut all = self.all_failing();
        all.any(|failing| failing.end.is_some_and(|end| end < 1.0))
    }

    /// Whether an entry says that actions fail while they are under way.
    pub(super) fn has_failures_during(&self) -> bool {
        let mut all = self.all_failing();
        all.any(|failing| failing.during_per_second.is_some_and(|rate| rate > 0.0))
    }

    fn all_failing(&self) -> impl Iterator<Item = &Failing> {
        let entries = self.schemas.values().chain(self.actions.values());
        entries
            .map(|success| &success.failing)
            .chain([&self.defaults.failing])
    }
}

/// What undoing a start does to facts.
fn undone(action: &Action) -> Vec<(FactId, bool)> {
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
    /// The fact that is meant when this action fails; `None` if an object is of the wrong type, so
    /// that there is no such fact.
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

    /// As in a file: `(on ?box floor)`.
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
