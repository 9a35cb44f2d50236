//! A problem without constraints whose plans keep those of another.

use std::collections::BTreeSet;

use elbowroom_model::ground;
use elbowroom_model::problem::{
    Atom, Body, Change, Condition, Effect, Guard, ObjectId, Predicate, PredicateId, Problem,
    Schema, Term, TimedChange, TimedInitial,
};
use elbowroom_model::{Modal, Task};
use elbowroom_num::Rational;

use super::clauses::{Literal, clauses, lifted};
use super::{Obstacle, counts_violations};

/// Most clauses that always hold.
const MOST_CLAUSES: usize = 5_000;

const NUMBERS: Obstacle = Obstacle::Feature(
    "`always`, `sometime-before` and `at-most-once` of numbers, derived facts or long formulas",
);
const OTHERS: Obstacle = Obstacle::Feature(
    "the constraints `sometime-after`, `always-within`, `hold-during` and `hold-after`",
);
const GUARDED: Obstacle = Obstacle::Feature(
    "trajectory constraints on what conditional effects or timed initials change",
);
const TOO_MANY: Obstacle = Obstacle::Feature("so many trajectory constraints");

struct Rewriting<'a> {
    task: &'a Task,
    problem: Problem,
    goals: Vec<Condition>,
    /// Clauses that hold at every moment, with the constraint that each comes from.
    always: Vec<(Vec<Literal>, String)>,
    /// Literals that hold once at most, with what says that this is over.
    once: Vec<(Literal, PredicateId)>,
}

/// The problem without constraints, with these preferences (by position among the task's soft
/// constraints) among those that are kept.
pub(super) fn without_constraints(task: &Task, demanded: &[usize]) -> Result<Problem, Obstacle> {
    let mut problem = task.problem().clone();
    // What is violated of the preferences, the judge counts in the task itself.
    problem.constraints.clear();
    problem.action_preferences.clear();
    problem.domain_constraints = 0;
    if counts_violations(task) {
        problem.metric = None;
    }
    let mut rewriting = Rewriting {
        task,
        goals: vec![problem.goal.clone()],
        problem,
        always: Vec::new(),
        once: Vec::new(),
    };
    let constraints = task.constraints();
    let soft = demanded
        .iter()
        .flat_map(|&position| &constraints.soft[position].all);
    for modal in constraints.hard.iter().chain(soft) {
        rewriting.modal(modal)?;
    }
    rewriting.finish()
}

impl Rewriting<'_> {
    fn modal(&mut self, modal: &Modal<ground::Condition>) -> Result<(), Obstacle> {
        let task = self.task;
        let text = || task.describe_modal(modal);
        match modal {
            Modal::AtEnd(c) => self.goals.push(lifted(task, c)),
            Modal::Always(c) => {
                for clause in clauses(task, c, true).ok_or(NUMBERS)? {
                    self.always.push((clause, text()));
                }
            }
            Modal::Sometime(c) => {
                let seen = self.observed(lifted(task, c), None);
                self.goals.push(holds(seen));
            }
            Modal::Within(time, c) => {
                let seen = self.observed(lifted(task, c), Some(time));
                self.goals.push(holds(seen));
            }
            Modal::SometimeBefore(c, d) => {
                let seen = self.observed(lifted(task, d), None);
                for mut clause in clauses(task, c, false).ok_or(NUMBERS)? {
                    clause.push(Literal {
                        predicate: seen,
                        objects: Vec::new(),
                        truth: true,
                    });
                    self.always.push((clause, text()));
                }
            }
            Modal::AtMostOnce(c) => {
                let found = clauses(task, c, true).ok_or(NUMBERS)?;
                let [clause] = found.as_slice() else {
                    return Err(NUMBERS);
                };
                let [literal] = clause.as_slice() else {
                    return Err(NUMBERS);
                };
                let over = self.predicate("over");
                self.once.push((literal.clone(), over));
            }
            Modal::SometimeAfter(..)
            | Modal::AlwaysWithin(..)
            | Modal::HoldDuring(..)
            | Modal::HoldAfter(..) => return Err(OTHERS),
        }
        Ok(())
    }

    /// A new predicate without arguments.
    fn predicate(&mut self, name: &str) -> PredicateId {
        let number = self.problem.predicates.len();
        self.problem.predicates.push(Predicate {
            // No name of a text has a space.
            name: format!("{name} {number}"),
            parameters: Vec::new(),
            is_derived: false,
        });
        PredicateId::from(number)
    }

    /// What becomes true when an action that only looks sees that a condition holds, no later than
    /// `deadline`.
    fn observed(&mut self, condition: Condition, deadline: Option<&Rational>) -> PredicateId {
        let seen = self.predicate("seen");
        let mut needs = vec![condition];
        if let Some(deadline) = deadline {
            let open = self.predicate("open");
            self.problem.initial_facts.push((open, Vec::new()));
            self.problem.timed.push(TimedInitial {
                // What looks at the deadline itself is ε before.
                time: deadline + self.task.epsilon(),
                change: TimedChange::Delete(open, Vec::new()),
            });
            needs.push(holds(open));
        }
        let name = format!("look {}", self.problem.schemas.len());
        self.problem.schemas.push(Schema {
            name,
            parameters: Vec::new(),
            unknowns: Vec::new(),
            body: Body::Instantaneous {
                condition: Condition::And(needs),
                effects: vec![always(Change::Add(atom(seen)))],
            },
        });
        seen
    }

    fn finish(mut self) -> Result<Problem, Obstacle> {
        let facts: BTreeSet<(PredicateId, Vec<ObjectId>)> =
            self.problem.initial_facts.iter().cloned().collect();
        let changing = changing(&self.problem);
        let is_true = |literal: &Literal| {
            facts.contains(&(literal.predicate, literal.objects.clone())) == literal.truth
        };
        let mut clauses: BTreeSet<Vec<Literal>> = BTreeSet::new();
        for (clause, constraint) in std::mem::take(&mut self.always) {
            if !clause.iter().any(is_true) {
                return Err(Obstacle::Broken(constraint));
            }
            let is_static = |literal: &Literal| !changing.contains(&literal.predicate);
            if clause.iter().any(|l| is_static(l) && is_true(l)) {
                continue;
            }
            let mut rest: Vec<Literal> = clause.into_iter().filter(|l| !is_static(l)).collect();
            rest.sort();
            rest.dedup();
            let is_tautology = rest.iter().any(|l| rest.contains(&l.clone().negated()));
            if !is_tautology {
                clauses.insert(rest);
            }
            if clauses.len() > MOST_CLAUSES {
                return Err(TOO_MANY);
            }
        }
        let guarded: BTreeSet<PredicateId> = clauses
            .iter()
            .flatten()
            .chain(self.once.iter().map(|(literal, _)| literal))
            .map(|literal| literal.predicate)
            .collect();
        let is_timed = self.problem.timed.iter().any(|timed| match &timed.change {
            TimedChange::Add(predicate, _) | TimedChange::Delete(predicate, _) => {
                guarded.contains(predicate)
            }
            TimedChange::Assign(..) => false,
        });
        if is_timed {
            return Err(GUARDED);
        }
        for schema in &mut self.problem.schemas {
            for (condition, effects) in snaps(&mut schema.body) {
                let mut needs = Vec::new();
                let mut more = Vec::new();
                for effect in effects.iter() {
                    let (written, truth) = match &effect.change {
                        Change::Add(atom) => (atom, true),
                        Change::Delete(atom) => (atom, false),
                        Change::Update { .. } => continue,
                    };
                    if !guarded.contains(&written.predicate) {
                        continue;
                    }
                    if effect.guard != Guard::default() || !effect.variables.is_empty() {
                        return Err(GUARDED);
                    }
                    let is_written = |literal: &Literal| literal.predicate == written.predicate;
                    for clause in &clauses {
                        let lost = clause.iter().filter(|l| is_written(l) && l.truth != truth);
                        for literal in lost {
                            let others = clause.iter().filter(|other| *other != literal);
                            let mut any = differs(written, &literal.objects);
                            any.extend(others.map(Literal::condition));
                            needs.push(Condition::Or(any));
                        }
                    }
                    for (literal, over) in self.once.iter().filter(|(l, _)| is_written(l)) {
                        let mut any = differs(written, &literal.objects);
                        if literal.truth == truth {
                            any.push(Condition::Not(Box::new(holds(*over))));
                            needs.push(Condition::Or(any));
                        } else {
                            // It ends, if it held.
                            any.push(literal.clone().negated().condition());
                            more.push(Effect {
                                variables: Vec::new(),
                                guard: Guard {
                                    now: Condition::Not(Box::new(Condition::Or(any))),
                                    ..Guard::default()
                                },
                                change: Change::Add(atom(*over)),
                            });
                        }
                    }
                }
                effects.extend(more);
                if !needs.is_empty() {
                    needs.insert(0, std::mem::take(condition));
                    *condition = Condition::And(needs);
                }
            }
        }
        self.problem.goal = Condition::And(self.goals);
        Ok(self.problem)
    }
}

/// The predicates of which some fact can change.
fn changing(problem: &Problem) -> BTreeSet<PredicateId> {
    let mut changing = BTreeSet::new();
    for timed in &problem.timed {
        if let TimedChange::Add(predicate, _) | TimedChange::Delete(predicate, _) = &timed.change {
            changing.insert(*predicate);
        }
    }
    for schema in &problem.schemas {
        let (first, second) = match &schema.body {
            Body::Instantaneous { effects, .. } => (effects.as_slice(), [].as_slice()),
            Body::Durative {
                start_effects,
                end_effects,
                ..
            } => (start_effects.as_slice(), end_effects.as_slice()),
        };
        for effect in first.iter().chain(second) {
            if let Change::Add(atom) | Change::Delete(atom) = &effect.change {
                changing.insert(atom.predicate);
            }
        }
    }
    changing
}

/// The conditions of an action that are read at one moment, with what it does then.
fn snaps(body: &mut Body) -> Vec<(&mut Condition, &mut Vec<Effect>)> {
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

/// The ways in which the arguments of an atom can be other objects than these.
fn differs(atom: &Atom, objects: &[ObjectId]) -> Vec<Condition> {
    let pairs = atom.arguments.iter().zip(objects);
    pairs
        .map(|(&term, &object)| {
            Condition::Not(Box::new(Condition::Equal(term, Term::Object(object))))
        })
        .collect()
}

fn atom(predicate: PredicateId) -> Atom {
    Atom {
        predicate,
        arguments: Vec::new(),
    }
}

fn holds(predicate: PredicateId) -> Condition {
    Condition::Atom(atom(predicate))
}

fn always(change: Change) -> Effect {
    Effect {
        variables: Vec::new(),
        guard: Guard::default(),
        change,
    }
}
