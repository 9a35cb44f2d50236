//! Action instances, found by trying objects for parameters, and the facts that they add.

use std::collections::BTreeSet;

use elbowroom_model::ground::{Action, Body, Change, Effect};
use elbowroom_model::problem::{self, Condition, ObjectId, PredicateId, SchemaId, Term};
use elbowroom_model::{RunningAction, Situation, Task};
use elbowroom_num::Rational;

use super::earliest_times::ConditionContext;
use super::initial_state::{InitialState, lasting};
use super::static_facts::StaticFacts;
use super::{EarliestTimes, Fact, NoPlanFlaw, ReachedFacts};

/// A fact that can become true although it is not listed, or earlier than listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Breach {
    /// The fact.
    pub fact: Fact,
    /// Earliest time at which it can become true, if the listed bounds hold.
    pub time: Rational,
    /// Happening that makes it true, in words.
    pub by: String,
}

/// Instances of a task's actions whose conditions a list of facts allows.
#[derive(Debug)]
pub struct Instances {
    pub(super) task: Task,
    pub(super) initial: InitialState,
    pub(super) static_facts: StaticFacts,
    pub(super) actions: Vec<Action>,
    known: BTreeSet<(SchemaId, Vec<ObjectId>)>,
    /// By schema.
    needs: Vec<Needs>,
}

/// Conditions that all instances of a schema need and that mention only objects.
#[derive(Debug, Default)]
struct Needs {
    /// Atoms that the start needs, or that only timed initials make true.
    atoms: Vec<problem::Atom>,
    /// Terms that have to denote the same object (`true`) or different ones.
    pairs: Vec<(Term, Term, bool)>,
}

impl Instances {
    /// Creates an empty list.
    ///
    /// # Errors
    /// When the task has a feature that the checker does not support.
    pub fn of(task: &Task) -> Result<Self, NoPlanFlaw> {
        Self::from(task, &Situation::initial(task))
    }

    /// Creates an empty list for a situation during an execution.
    ///
    /// # Errors
    /// When the task has a feature that the checker does not support.
    pub fn from(task: &Task, situation: &Situation) -> Result<Self, NoPlanFlaw> {
        if let Some(feature) = task.unsupported_by_analysis() {
            return Err(NoPlanFlaw::Unknown(feature));
        }
        // Ids of facts that only the checker mentions belong to its own copy of the task.
        let (beginning, task) = InitialState::of(task, situation);
        let lasting = StaticFacts::of(&task, &beginning);
        let schemas = task.problem().schemas.iter();
        let heads = task.problem().rules.iter().map(|rule| rule.predicate);
        let derived: BTreeSet<PredicateId> = heads.collect();
        let needs = schemas
            .map(|schema| needs(schema, &lasting, &derived))
            .collect();
        Ok(Self {
            initial: beginning,
            static_facts: lasting,
            actions: Vec::new(),
            known: BTreeSet::new(),
            needs,
            task,
        })
    }

    /// Creates an empty list that assumes an arbitrary value for each fluent without a value.
    ///
    /// # Errors
    /// When the task has a feature that the checker does not support.
    pub fn with_assumed_values(task: &Task, situation: &Situation) -> Result<Self, NoPlanFlaw> {
        let mut instances = Self::from(task, situation)?;
        instances.static_facts.assumes_values = true;
        Ok(instances)
    }

    /// Adds the instances that the reached facts make possible. Returns the number of tries.
    ///
    /// # Errors
    /// [`NoPlanFlaw::TooMany`] after `most_steps` tries.
    pub fn extend(&mut self, reached: &ReachedFacts, most_steps: u64) -> Result<u64, NoPlanFlaw> {
        let mut steps = most_steps;
        for number in 0..self.needs.len() {
            let mut binding = Vec::new();
            self.bind(SchemaId::from(number), reached, &mut binding, &mut steps)?;
        }
        Ok(most_steps - steps)
    }

    /// Tries the objects of the next parameter.
    fn bind(
        &mut self,
        schema: SchemaId,
        reached: &ReachedFacts,
        binding: &mut Vec<ObjectId>,
        steps: &mut u64,
    ) -> Result<(), NoPlanFlaw> {
        *steps = steps.checked_sub(1).ok_or(NoPlanFlaw::TooMany)?;
        if !self.may_be_bound(schema, reached, binding) {
            return Ok(());
        }
        let parameters = &self.task.problem().schemas[schema.index()].parameters;
        let Some(parameter) = parameters.get(binding.len()) else {
            if self.known.insert((schema, binding.clone()))
                && let Ok(action) = self.task.instantiate(schema, binding)
            {
                // No plan contains an instance that reads a fluent without a value.
                let mut valueless = BTreeSet::new();
                self.static_facts
                    .read_by_action(&self.task, &action, &mut valueless);
                if valueless.is_empty() || self.static_facts.assumes_values {
                    self.actions.push(action);
                }
            }
            return Ok(());
        };
        let objects: Vec<ObjectId> = self.task.problem().objects_of(&parameter.types).collect();
        for object in objects {
            binding.push(object);
            self.bind(schema, reached, binding, steps)?;
            binding.pop();
        }
        Ok(())
    }

    /// Returns `true` if all needs that the last bound parameter completes can be satisfied.
    fn may_be_bound(&self, schema: SchemaId, reached: &ReachedFacts, binding: &[ObjectId]) -> bool {
        let Needs { atoms, pairs } = &self.needs[schema.index()];
        let object = |term: &Term| match term {
            Term::Variable(variable) => binding.get(*variable).copied(),
            Term::Object(object) => Some(*object),
        };
        let are_bound = pairs.iter().all(|(left, right, is_same)| {
            let both = object(left).zip(object(right));
            both.is_none_or(|(left, right)| (left == right) == *is_same)
        });
        are_bound
            && atoms.iter().all(|atom| {
                let objects: Option<Vec<ObjectId>> = atom.arguments.iter().map(object).collect();
                let Some(objects) = objects else { return true };
                let fact = (atom.predicate, objects);
                match self.static_facts.spans(&fact) {
                    Some(spans) => !spans.is_empty(),
                    None => reached.contains_key(&fact),
                }
            })
    }

    /// Returns the number of instances.
    pub fn len(&self) -> usize {
        self.actions.len()
    }

    /// Returns `true` if there are no instances.
    pub fn is_empty(&self) -> bool {
        self.actions.is_empty()
    }

    /// Returns all violations of the list, with the earliest time of each fact. If there are none,
    /// and all instances have been added, the list is an invariant.
    pub fn breaches(&self, reached: &ReachedFacts) -> Vec<Breach> {
        let mut breaches = Vec::new();
        let mut note = |fact: Fact, time: &Rational, by: &dyn Fn() -> String| {
            let is_listed = reached.get(&fact).is_some_and(|from| from <= time);
            if !is_listed && self.static_facts.spans(&fact).is_none() {
                let (time, by) = (time.clone(), by());
                breaches.push(Breach { fact, time, by });
            }
        };
        for &fact in &self.task.initial().facts {
            let by = || "the initial state".to_owned();
            note(self.task.atom(fact), &self.initial.now, &by);
        }
        for happening in &self.initial.timed {
            for change in &happening.changes {
                if let Change::Add(fact) = change {
                    let by = || "a timed initial".to_owned();
                    note(self.task.atom(*fact), &happening.time, &by);
                }
            }
        }
        let moments = self.earliest_times(reached);
        for action in &self.actions {
            for (fact, time) in achievable_facts(&moments, action) {
                note(fact, &time, &|| format!("`{}`", action.name));
            }
        }
        for running in &self.initial.running {
            for (fact, time) in facts_achieved_by_end(&moments, running) {
                note(fact, &time, &|| {
                    format!("`{}`, running", running.action.name)
                });
            }
        }
        for rule in self.task.rules().iter() {
            if let Some(time) = moments.next(&rule.body, &self.initial.now, ConditionContext::All) {
                note(self.task.atom(rule.head), &time, &|| "a rule".to_owned());
            }
        }
        breaches
    }

    /// Returns `true` if the list does not exclude the goal.
    pub fn is_goal_in_reach(&self, reached: &ReachedFacts) -> bool {
        self.earliest_times(reached)
            .can_hold_at_end(self.task.goal())
    }

    pub(super) fn earliest_times<'a>(&'a self, reached: &'a ReachedFacts) -> EarliestTimes<'a> {
        EarliestTimes {
            task: &self.task,
            static_facts: &self.static_facts,
            reached,
            now: &self.initial.now,
        }
    }
}

/// Returns the facts that an action adds, with their earliest times.
fn achievable_facts(moments: &EarliestTimes<'_>, action: &Action) -> Vec<(Fact, Rational)> {
    let mut facts = Vec::new();
    let mut add = |effects: &[Effect], start: &Rational, time: &Rational| {
        for effect in effects {
            let Change::Add(fact) = effect.change else {
                continue;
            };
            let guard = &effect.guard;
            let reads = moments.next(&guard.at_start, start, ConditionContext::All);
            let happens = moments.next(&guard.now, time, ConditionContext::All);
            if let (Some(_), Some(time)) = (reads, happens) {
                facts.push((moments.task.atom(fact), time));
            }
        }
    };
    match &action.body {
        Body::Instantaneous(snap) => {
            if let Some(time) = moments.instant(snap) {
                add(&snap.effects, &time, &time);
            }
        }
        Body::Durative(body) => {
            if let Some((start, _)) = moments.ends(body, ConditionContext::StaticOnly) {
                add(&body.start.effects, &start, &start);
            }
            if let Some((start, end)) = moments.ends(body, ConditionContext::All) {
                add(&body.end.effects, &start, &end);
            }
        }
    }
    facts
}

/// Returns the facts that the end of a running action adds, with their earliest times.
fn facts_achieved_by_end(
    moments: &EarliestTimes<'_>,
    running: &RunningAction,
) -> Vec<(Fact, Rational)> {
    let Some(body) = running.action.durative() else {
        return Vec::new();
    };
    let (least, most) = lasting(running, moments.now);
    let earliest = &running.start + &least;
    // The over-all condition is ignored: another happening may establish it at once.
    let Some(end) = moments.next(&body.end.condition, &earliest, ConditionContext::All) else {
        return Vec::new();
    };
    if most.is_some_and(|most| end > &running.start + &most) {
        return Vec::new();
    }
    let adds = body.end.effects.iter().filter_map(|effect| {
        let Change::Add(fact) = effect.change else {
            return None;
        };
        let time = moments.next(&effect.guard.now, &end, ConditionContext::All)?;
        Some((moments.task.atom(fact), time))
    });
    adds.collect()
}

/// Returns the [`Needs`] of a schema. Derived facts are left out, because their rules are ground
/// only for instances that mention them.
fn needs(
    schema: &problem::Schema,
    lasting: &StaticFacts,
    derived: &BTreeSet<PredicateId>,
) -> Needs {
    let mut needs = Needs::default();
    let is_basic = |atom: &problem::Atom| !derived.contains(&atom.predicate);
    match &schema.body {
        problem::Body::Instantaneous { condition, .. } => {
            collect(condition, &is_basic, &mut needs);
        }
        problem::Body::Durative {
            at_start,
            over_all,
            at_end,
            ..
        } => {
            collect(at_start, &is_basic, &mut needs);
            // Over-all conditions of an action that may have duration 0 are left to the check of
            // instances.
            let is_fixed = |atom: &problem::Atom| lasting.is_fixed(atom.predicate);
            collect(at_end, &is_fixed, &mut needs);
            if has_positive_duration(schema) {
                collect(over_all, &is_fixed, &mut needs);
            }
        }
    }
    needs
}

/// Returns `true` if a constant lower bound implies that all instances have a positive duration.
fn has_positive_duration(schema: &problem::Schema) -> bool {
    let problem::Body::Durative { duration, .. } = &schema.body else {
        return false;
    };
    duration.iter().any(|constraint| {
        let is_lower = !matches!(
            constraint.comparison,
            problem::Comparison::AtMost | problem::Comparison::Less
        );
        matches!(&constraint.bound, problem::Expression::Constant(bound)
            if is_lower && *bound > Rational::ZERO)
    })
}

/// Collects the conjuncts that are atoms for which `counts` is true, or compare objects.
fn collect(condition: &Condition, counts: &dyn Fn(&problem::Atom) -> bool, needs: &mut Needs) {
    match condition {
        Condition::And(parts) => {
            for part in parts {
                collect(part, counts, needs);
            }
        }
        Condition::Atom(atom) if counts(atom) => needs.atoms.push(atom.clone()),
        Condition::Equal(left, right) => needs.pairs.push((*left, *right, true)),
        Condition::Not(part) => {
            if let Condition::Equal(left, right) = &**part {
                needs.pairs.push((*left, *right, false));
            }
        }
        _ => {}
    }
}
