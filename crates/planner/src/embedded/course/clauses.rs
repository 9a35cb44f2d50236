//! Conditions on facts as clauses.

use elbowroom_model::Task;
use elbowroom_model::ground;
use elbowroom_model::problem::{Atom, Condition, Fluent, ObjectId, PredicateId, Term};

/// Most clauses of one condition.
const MOST_CLAUSES: usize = 64;

/// A fact or its negation.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Literal {
    pub(super) predicate: PredicateId,
    pub(super) objects: Vec<ObjectId>,
    pub(super) truth: bool,
}

impl Literal {
    pub(super) fn negated(mut self) -> Self {
        self.truth = !self.truth;
        self
    }

    /// As a condition.
    pub(super) fn condition(&self) -> Condition {
        let atom = Condition::Atom(Atom {
            predicate: self.predicate,
            arguments: self.objects.iter().copied().map(Term::Object).collect(),
        });
        if self.truth {
            atom
        } else {
            Condition::Not(Box::new(atom))
        }
    }
}

/// Clauses that together say that the condition has this truth; `None` if it compares numbers,
/// reads derived facts, or has too many clauses.
pub(super) fn clauses(
    task: &Task,
    condition: &ground::Condition,
    truth: bool,
) -> Option<Vec<Vec<Literal>>> {
    let (parts, is_all) = match condition {
        ground::Condition::Compare(..) => return None,
        ground::Condition::Fact(fact) => {
            let (predicate, objects) = task.atom(*fact);
            if task.is_derived(*fact) {
                return None;
            }
            let literal = Literal {
                predicate,
                objects,
                truth,
            };
            return Some(vec![vec![literal]]);
        }
        ground::Condition::Not(part) => return clauses(task, part, !truth),
        ground::Condition::And(parts) => (parts, truth),
        ground::Condition::Or(parts) => (parts, !truth),
    };
    let mut all: Vec<Vec<Literal>> = if is_all { Vec::new() } else { vec![Vec::new()] };
    for part in parts {
        let own = clauses(task, part, truth)?;
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
        if all.len() > MOST_CLAUSES {
            return None;
        }
    }
    Some(all)
}

/// The condition with objects in the place of numbers of facts.
pub(super) fn lifted(task: &Task, condition: &ground::Condition) -> Condition {
    let many = |parts: &[ground::Condition]| parts.iter().map(|p| lifted(task, p)).collect();
    let expression = |part: &ground::Expression| {
        part.map_fluents(&mut |fluent| {
            let (function, objects) = task.application(*fluent);
            Fluent {
                function,
                arguments: objects.into_iter().map(Term::Object).collect(),
            }
        })
    };
    match condition {
        ground::Condition::Fact(fact) => {
            let (predicate, objects) = task.atom(*fact);
            Condition::Atom(Atom {
                predicate,
                arguments: objects.into_iter().map(Term::Object).collect(),
            })
        }
        ground::Condition::Compare(comparison, left, right) => {
            Condition::Compare(*comparison, expression(left), expression(right))
        }
        ground::Condition::Not(part) => Condition::Not(Box::new(lifted(task, part))),
        ground::Condition::And(parts) => Condition::And(many(parts)),
        ground::Condition::Or(parts) => Condition::Or(many(parts)),
    }
}
