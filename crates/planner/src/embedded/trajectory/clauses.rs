//! Conditions as clauses.

use std::sync::Arc;

use elbowroom_model::Task;
use elbowroom_model::derivation::Rules;
use elbowroom_model::ground::{self, FactId};
use elbowroom_model::problem::{
    Atom, Comparison, Condition, Expression, Fluent, ObjectId, PredicateId, Term,
};

/// Maximum number of clauses of one condition.
const MAX_CLAUSES: usize = 64;

/// Maximum number of parts of one condition, including those that replace derived facts.
const MAX_PARTS: usize = 2_000;

/// A fact, a comparison of numbers, or the negation of one.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Literal {
    pub(super) subject: LiteralSubject,
    pub(super) truth: bool,
}

/// The subject of a literal.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum LiteralSubject {
    Fact(PredicateId, Vec<ObjectId>),
    /// Index in [`Numbers`].
    Number(usize),
}

/// A comparison whose fluents have objects as arguments.
pub(super) type Number = (Comparison, Expression, Expression);

/// All comparisons among the literals.
#[derive(Debug, Default)]
pub(super) struct Numbers(Vec<Number>);

impl Numbers {
    fn position(&mut self, number: Number) -> usize {
        let known = self.0.iter().position(|other| *other == number);
        known.unwrap_or_else(|| {
            self.0.push(number);
            self.0.len() - 1
        })
    }

    pub(super) fn get(&self, position: usize) -> &Number {
        &self.0[position]
    }
}

impl Literal {
    /// Returns the literal that a fact without arguments has this truth.
    pub(super) fn without_arguments(predicate: PredicateId, truth: bool) -> Self {
        Self {
            subject: LiteralSubject::Fact(predicate, Vec::new()),
            truth,
        }
    }

    pub(super) fn negated(mut self) -> Self {
        self.truth = !self.truth;
        self
    }

    /// Returns the literal as a condition.
    pub(super) fn condition(&self, numbers: &Numbers) -> Condition {
        let condition = match &self.subject {
            LiteralSubject::Fact(predicate, objects) => fact(*predicate, objects),
            LiteralSubject::Number(position) => {
                let (comparison, left, right) = numbers.get(*position).clone();
                Condition::Compare(comparison, left, right)
            }
        };
        if self.truth {
            condition
        } else {
            Condition::Not(Box::new(condition))
        }
    }
}

fn fact(predicate: PredicateId, objects: &[ObjectId]) -> Condition {
    Condition::Atom(Atom {
        predicate,
        arguments: objects.iter().copied().map(Term::Object).collect(),
    })
}

/// Returns clauses whose conjunction states that the condition has this truth. Derived facts are
/// replaced by the bodies of their rules. Returns `None` if a derived fact depends on itself, or
/// there are too many clauses.
pub(super) fn clauses(
    task: &Task,
    condition: &ground::Condition,
    truth: bool,
    numbers: &mut Numbers,
) -> Option<Vec<Vec<Literal>>> {
    let mut unfolding = Unfolding {
        task,
        rules: task.rules(),
        numbers,
        open: Vec::new(),
        parts: 0,
    };
    unfolding.clauses(condition, truth)
}

/// Conversion of a condition to clauses.
struct Unfolding<'a> {
    task: &'a Task,
    rules: Arc<Rules>,
    numbers: &'a mut Numbers,
    /// The derived facts that are being replaced, each part of the definition of the one before.
    open: Vec<FactId>,
    /// The number of parts replaced so far.
    parts: usize,
}

impl Unfolding<'_> {
    fn clauses(&mut self, condition: &ground::Condition, truth: bool) -> Option<Vec<Vec<Literal>>> {
        self.parts += 1;
        if self.parts > MAX_PARTS {
            return None;
        }
        let task = self.task;
        match condition {
            ground::Condition::Compare(comparison, left, right) => {
                let number = (
                    *comparison,
                    lifted_number(task, left),
                    lifted_number(task, right),
                );
                let matter = LiteralSubject::Number(self.numbers.position(number));
                Some(vec![vec![Literal {
                    subject: matter,
                    truth,
                }]])
            }
            ground::Condition::Fact(fact) if task.is_derived(*fact) => {
                if self.open.contains(fact) {
                    return None;
                }
                let rules = Arc::clone(&self.rules);
                let bodies = rules.of(*fact).iter().map(|rule| &rule.body);
                self.open.push(*fact);
                let found = self.joined(bodies, truth, !truth);
                self.open.pop();
                found
            }
            ground::Condition::Fact(fact) => {
                let (predicate, objects) = task.atom(*fact);
                let matter = LiteralSubject::Fact(predicate, objects);
                Some(vec![vec![Literal {
                    subject: matter,
                    truth,
                }]])
            }
            ground::Condition::Not(part) => self.clauses(part, !truth),
            ground::Condition::And(parts) => self.joined(parts, truth, truth),
            ground::Condition::Or(parts) => self.joined(parts, truth, !truth),
        }
    }

    /// Returns clauses which state that all of the parts, or one of them, have this truth.
    fn joined<'c>(
        &mut self,
        parts: impl IntoIterator<Item = &'c ground::Condition>,
        truth: bool,
        is_all: bool,
    ) -> Option<Vec<Vec<Literal>>> {
        let mut all: Vec<Vec<Literal>> = if is_all { Vec::new() } else { vec![Vec::new()] };
        for part in parts {
            let own = self.clauses(part, truth)?;
            if is_all {
                all.extend(own);
            } else {
                let joined = all.iter().flat_map(|clause| {
                    own.iter().map(move |other| {
                        let mut clause = clause.clone();
                        clause.extend(other.iter().cloned());
                        clause
                    })
                });
                all = joined.collect();
            }
            if all.len() > MAX_CLAUSES {
                return None;
            }
        }
        Some(all)
    }
}

/// Returns the condition with predicates and objects instead of fact numbers.
pub(super) fn lifted(task: &Task, condition: &ground::Condition) -> Condition {
    let many = |parts: &[ground::Condition]| parts.iter().map(|p| lifted(task, p)).collect();
    match condition {
        ground::Condition::Fact(fact) => {
            let (predicate, objects) = task.atom(*fact);
            self::fact(predicate, &objects)
        }
        ground::Condition::Compare(comparison, left, right) => Condition::Compare(
            *comparison,
            lifted_number(task, left),
            lifted_number(task, right),
        ),
        ground::Condition::Not(part) => Condition::Not(Box::new(lifted(task, part))),
        ground::Condition::And(parts) => Condition::And(many(parts)),
        ground::Condition::Or(parts) => Condition::Or(many(parts)),
    }
}

fn lifted_number(task: &Task, expression: &ground::Expression) -> Expression {
    expression.map_fluents(&mut |fluent| {
        let (function, objects) = task.application(*fluent);
        Fluent {
            function,
            arguments: objects.into_iter().map(Term::Object).collect(),
        }
    })
}
