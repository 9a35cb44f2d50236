//! Permanent information from the problem itself: facts and numbers that only timed initials change, or
//! nothing.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_model::Task;
use elbowroom_model::ground::{Change, Expression};
use elbowroom_model::problem::{self, Body, FunctionId, PredicateId, UpdateOperator};
use elbowroom_num::Rational;

use super::Fact;
use super::initial_state::InitialState;
use super::timed_numbers::TimedNumbers;

/// Interval during which a fact may be true; an end of `None` is never.
pub(super) type Span = (Rational, Option<Rational>);

/// Facts and values that the problem itself determines.
#[derive(Debug)]
pub(super) struct StaticFacts {
    /// Predicates that some action or rule can make true.
    can_become_true: BTreeSet<PredicateId>,
    /// Predicates that some action or timed initial can make false, and those of rules.
    can_become_false: BTreeSet<PredicateId>,
    /// Functions whose values change.
    changing: BTreeSet<FunctionId>,
    /// The functions among them whose values actions change.
    changed_by_actions: BTreeSet<FunctionId>,
    /// Values that timed initials assign.
    pub(super) numbers: TimedNumbers,
    /// Functions that some effect or timed initial assigns a value.
    assigned: BTreeSet<FunctionId>,
    /// Intervals of the facts that only timed initials make true. Other facts of these predicates
    /// are never true.
    spans: BTreeMap<Fact, Vec<Span>>,
    /// Assumes an arbitrary value for each fluent without one.
    pub(super) assumes_values: bool,
}

impl StaticFacts {
    /// Collects the information for a task with this beginning. Timed initials up to that time are
    /// part of the initial state, unless it is the task's own beginning.
    pub(super) fn of(task: &Task, beginning: &InitialState) -> Self {
        let mut lasting = Self {
            can_become_true: BTreeSet::new(),
            can_become_false: BTreeSet::new(),
            changing: BTreeSet::new(),
            changed_by_actions: BTreeSet::new(),
            numbers: TimedNumbers::of(beginning),
            assigned: BTreeSet::new(),
            spans: BTreeMap::new(),
            assumes_values: false,
        };
        let problem = task.problem();
        for schema in &problem.schemas {
            match &schema.body {
                Body::Instantaneous { effects, .. } => lasting.note(effects),
                Body::Durative {
                    start_effects,
                    end_effects,
                    continuous,
                    ..
                } => {
                    lasting.note(start_effects);
                    lasting.note(end_effects);
                    let functions = continuous.iter().map(|effect| effect.fluent.function);
                    lasting.changing.extend(functions);
                }
            }
        }
        for rule in &problem.rules {
            lasting.can_become_true.insert(rule.predicate);
            lasting.can_become_false.insert(rule.predicate);
        }
        lasting.changed_by_actions = lasting.changing.clone();
        lasting.follow_timed(task, beginning);
        lasting
    }

    fn note(&mut self, effects: &[problem::Effect]) {
        for effect in effects {
            match &effect.change {
                problem::Change::Add(atom) => self.can_become_true.insert(atom.predicate),
                problem::Change::Delete(atom) => self.can_become_false.insert(atom.predicate),
                problem::Change::Update {
                    fluent, operator, ..
                } => {
                    if *operator == UpdateOperator::Assign {
                        self.assigned.insert(fluent.function);
                    }
                    self.changing.insert(fluent.function)
                }
            };
        }
    }

    fn follow_timed(&mut self, task: &Task, beginning: &InitialState) {
        for &fact in &task.initial().facts {
            self.begin(task.atom(fact), &beginning.now);
        }
        for happening in &beginning.timed {
            // A fact that is deleted and added at one time is true.
            for change in &happening.changes {
                if let Change::Delete(fact) = change {
                    let fact = task.atom(*fact);
                    self.can_become_false.insert(fact.0);
                    if let Some((_, until)) = self.spans.get_mut(&fact).and_then(|s| s.last_mut()) {
                        until.get_or_insert_with(|| happening.time.clone());
                    }
                }
            }
            for change in &happening.changes {
                match change {
                    Change::Add(fact) => self.begin(task.atom(*fact), &happening.time),
                    Change::Update { fluent, .. } => {
                        let function = task.function_of(*fluent);
                        self.changing.insert(function);
                        self.assigned.insert(function);
                    }
                    Change::Delete(_) => {}
                }
            }
        }
    }

    fn begin(&mut self, fact: Fact, time: &Rational) {
        if self.can_become_true.contains(&fact.0) {
            return;
        }
        let spans = self.spans.entry(fact).or_default();
        match spans.last_mut() {
            // An addition wins over a deletion at the same time.
            Some((_, until)) if until.as_ref() == Some(time) => *until = None,
            Some((_, None)) => {}
            _ => spans.push((time.clone(), None)),
        }
    }

    /// Returns the intervals of a fact, if only timed initials make facts of its predicate true.
    pub(super) fn spans(&self, fact: &Fact) -> Option<&[Span]> {
        if self.can_become_true.contains(&fact.0) {
            return None;
        }
        Some(self.spans.get(fact).map_or(&[], Vec::as_slice))
    }

    /// Returns `true` if only timed initials make facts of the predicate true.
    pub(super) fn is_fixed(&self, predicate: PredicateId) -> bool {
        !self.can_become_true.contains(&predicate)
    }

    /// Returns `true` if an action may change a fluent of the function.
    pub(super) fn is_changed_by_actions(&self, function: FunctionId) -> bool {
        self.changed_by_actions.contains(&function)
    }

    /// Returns `true` if some fluent of the function is assigned a value.
    pub(super) fn is_assigned(&self, function: FunctionId) -> bool {
        self.assigned.contains(&function)
    }

    /// Returns `true` if the fact is true at all times.
    pub(super) fn is_always_true(&self, task: &Task, fact: &Fact) -> bool {
        let found = task.find_fact(fact.0, &fact.1);
        let is_true = found.is_some_and(|found| task.initial().facts.contains(&found));
        is_true && !self.can_become_false.contains(&fact.0)
    }

    /// Returns the value of an expression, as far as it is known.
    pub(super) fn value(&self, task: &Task, expression: &Expression) -> Value {
        match self.stated_value(task, expression) {
            Value::Undefined if self.assumes_values => Value::Unknown,
            value => value,
        }
    }

    /// Returns the value of an expression by the problem alone, without assumed values.
    pub(super) fn stated_value(&self, task: &Task, expression: &Expression) -> Value {
        let mut is_open = false;
        let value = expression.evaluate(&mut |leaf| match leaf {
            Expression::Fluent(fluent)
                if !self.changing.contains(&task.function_of(*fluent))
                    || self.is_valueless(task, *fluent) =>
            {
                task.initial().values.get(fluent).cloned()
            }
            _ => {
                is_open = true;
                None
            }
        });
        match value {
            Some(value) => Value::Known(value),
            None if is_open => Value::Unknown,
            None => Value::Undefined,
        }
    }
}

/// Value of an expression, as far as the problem determines it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Value {
    /// It has this value at all times.
    Known(Rational),
    /// It never has a value; no condition that reads it holds.
    Undefined,
    /// It may have any value.
    Unknown,
}
