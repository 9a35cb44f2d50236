//! Observer and waiting actions, and the changes by the actions of a problem.

use std::collections::BTreeSet;

use elbowroom_model::problem::{
    Atom, Body, Change, Comparison, Condition, DurationConstraint, Effect, Expression, FunctionId,
    Guard, Predicate, PredicateId, Problem, Schema, TimedChange, TimedInitial,
};
use elbowroom_num::Rational;

use super::regression::{all, not};
use super::rewriting::Rewriting;

impl Rewriting<'_> {
    /// Adds a predicate without arguments.
    pub(super) fn predicate(&mut self, name: &str) -> PredicateId {
        let number = self.problem.predicates.len();
        self.problem.predicates.push(Predicate {
            // No name in a text contains a space.
            name: format!("{name} {number}"),
            parameters: Vec::new(),
            is_derived: false,
        });
        PredicateId::from(number)
    }

    /// Adds a timed initial.
    pub(super) fn timed(&mut self, time: Rational, change: TimedChange) {
        self.problem.timed.push(TimedInitial { time, change });
    }

    /// Adds an instantaneous action.
    pub(super) fn add_instantaneous(&mut self, needs: Vec<Condition>, changes: Vec<Change>) {
        let body = Body::Instantaneous {
            condition: all(needs),
            effects: changes.into_iter().map(always).collect(),
        };
        self.schema("look", body);
    }

    /// Adds an observer of a condition, and returns the fact that it adds when the condition holds,
    /// no later than `deadline`.
    pub(super) fn add_observer(
        &mut self,
        condition: Condition,
        deadline: Option<&Rational>,
    ) -> PredicateId {
        let seen = self.predicate("seen");
        let mut needs = vec![condition];
        needs.extend(deadline.map(|deadline| holds(self.observation_window(deadline))));
        self.add_instantaneous(needs, vec![add(seen)]);
        seen
    }

    /// Returns a fact that observers may need. It holds until conditions that become true by this
    /// time have been observed.
    pub(super) fn observation_window(&mut self, time: &Rational) -> PredicateId {
        let open = self.predicate("open");
        let epsilon = self.task.epsilon();
        self.problem.initial_facts.push((open, Vec::new()));
        // ε after changes at that time, and ε before the end.
        let close = time + epsilon + epsilon;
        self.timed(close, TimedChange::Delete(open, Vec::new()));
        open
    }

    /// Adds an action that ends when `answer` holds, at most `time` after a happening that needs
    /// the returned fact. The fact holds while the action runs.
    pub(super) fn add_waiting_action(&mut self, time: &Rational, answer: Condition) -> PredicateId {
        let waits = self.predicate("waits");
        let epsilon = self.task.epsilon();
        let body = Body::Durative {
            duration: vec![DurationConstraint {
                comparison: Comparison::AtMost,
                // It begins ε before the happening that needs it, and ends ε after the condition
                // becomes true.
                bound: Expression::Constant(time + epsilon + epsilon),
                at_end: false,
            }],
            at_start: not(holds(waits)),
            over_all: Condition::TRUE,
            at_end: answer,
            start_effects: vec![always(add(waits))],
            end_effects: vec![always(delete(waits))],
            continuous: Vec::new(),
        };
        self.schema("wait", body);
        waits
    }

    fn schema(&mut self, name: &str, body: Body) {
        self.problem.schemas.push(Schema {
            // No name in a text contains a space.
            name: format!("{name} {}", self.problem.schemas.len()),
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body,
        });
    }
}

/// Predicates and functions that can change in a problem.
pub(super) struct Changing {
    pub(super) predicates: BTreeSet<PredicateId>,
    pub(super) functions: BTreeSet<FunctionId>,
    /// Functions that also change outside of happenings of actions.
    pub(super) moving: BTreeSet<FunctionId>,
}

impl Changing {
    pub(super) fn of(problem: &Problem) -> Self {
        let mut changing = Self {
            predicates: BTreeSet::new(),
            functions: BTreeSet::new(),
            moving: BTreeSet::new(),
        };
        for timed in &problem.timed {
            match &timed.change {
                TimedChange::Add(predicate, _) | TimedChange::Delete(predicate, _) => {
                    changing.predicates.insert(*predicate);
                }
                TimedChange::Assign(function, ..) => {
                    changing.moving.insert(*function);
                }
            }
        }
        for schema in &problem.schemas {
            let (first, second) = match &schema.body {
                Body::Instantaneous { effects, .. } => (effects.as_slice(), [].as_slice()),
                Body::Durative {
                    start_effects,
                    end_effects,
                    continuous,
                    ..
                } => {
                    let moving = continuous.iter().map(|effect| effect.fluent.function);
                    changing.moving.extend(moving);
                    (start_effects.as_slice(), end_effects.as_slice())
                }
            };
            for effect in first.iter().chain(second) {
                match &effect.change {
                    Change::Add(atom) | Change::Delete(atom) => {
                        changing.predicates.insert(atom.predicate);
                    }
                    Change::Update { fluent, .. } => {
                        changing.functions.insert(fluent.function);
                    }
                }
            }
        }
        changing.functions.extend(&changing.moving);
        changing
    }
}

/// Returns the conditions of an action at each moment, with the effects at that moment.
pub(super) fn snaps(body: &mut Body) -> Vec<(&mut Condition, &mut Vec<Effect>)> {
    match body {
        Body::Instantaneous { condition, effects } => vec![(condition, effects)],
        Body::Durative {
            at_start,
            at_end,
            start_effects,
            end_effects,
            ..
        } => vec![(at_start, start_effects), (at_end, end_effects)],
    }
}

fn atom(predicate: PredicateId) -> Atom {
    Atom {
        predicate,
        arguments: Vec::new(),
    }
}

pub(super) fn holds(predicate: PredicateId) -> Condition {
    Condition::Atom(atom(predicate))
}

pub(super) fn add(predicate: PredicateId) -> Change {
    Change::Add(atom(predicate))
}

pub(super) fn delete(predicate: PredicateId) -> Change {
    Change::Delete(atom(predicate))
}

fn always(change: Change) -> Effect {
    Effect {
        variables: Vec::new(),
        guard: Guard::default(),
        change,
    }
}
