//! Clauses that timed initials make false.
//!
//! A timed initial has no condition and always has the same effect. So an observer observes before
//! it that another literal of the clause holds, and locks the literal until then.

use std::collections::BTreeSet;

use elbowroom_model::Modal;
use elbowroom_model::problem::{Condition, TimedChange};
use elbowroom_num::Rational;

use super::Obstacle;
use super::actions::{add, holds};
use super::clauses::{Literal, LiteralSubject};
use super::regression::any;
use super::rewriting::{Consequence, Rewriting, WatchedClause};

const ENDED: Obstacle = Obstacle::Feature(
    "trajectory constraints on conditions that may hold only once and that timed initials end",
);

impl Rewriting<'_> {
    /// Returns `true` if a clause may be stricter than its constraint: a condition that may hold
    /// once counts as over if timed initials may have ended it.
    fn has_rough_clauses(&self) -> bool {
        let mut constraints = self.task.constraints().hard.iter();
        constraints.any(|modal| matches!(modal, Modal::AtMostOnce(_)))
    }

    /// Returns the times at which timed initials make a literal false.
    pub(super) fn falsification_times(&self, literal: &Literal) -> BTreeSet<Rational> {
        self.change_times(literal, !literal.truth)
    }

    fn change_times(&self, literal: &Literal, truth: bool) -> BTreeSet<Rational> {
        let LiteralSubject::Fact(predicate, objects) = &literal.subject else {
            return BTreeSet::new();
        };
        let timed = self.problem.timed.iter();
        let own = timed.filter(|timed| match &timed.change {
            TimedChange::Add(other, own) => truth && other == predicate && own == objects,
            TimedChange::Delete(other, own) => !truth && other == predicate && own == objects,
            TimedChange::Assign(..) => false,
        });
        own.map(|timed| timed.time.clone()).collect()
    }

    /// Compiles the effects of timed initials on the clauses.
    pub(super) fn settle_timed(&mut self) -> Result<(), Obstacle> {
        let mut more = Vec::new();
        for one in self.watched.clone() {
            if matches!(one.consequence, Consequence::Effect(..)) {
                continue;
            }
            let against = one.clause.iter().flat_map(|l| self.falsification_times(l));
            let times: BTreeSet<Rational> = against.collect();
            let (from, until) = &one.during;
            let matters =
                |time: &&Rational| *time > from && until.as_ref().is_none_or(|until| *time < until);
            for time in times.iter().filter(matters) {
                let is_saved = |l: &Literal| self.change_times(l, l.truth).contains(time);
                if one.clause.iter().any(is_saved) {
                    continue;
                }
                let is_lost = |l: &&Literal| self.falsification_times(l).contains(time);
                let rest: Vec<Literal> =
                    one.clause.iter().filter(|l| !is_lost(l)).cloned().collect();
                let settled = self.ensure_one_holds(&one, time, rest);
                more.extend(self.apply_coverage(settled)?.flatten());
            }
        }
        self.watched.extend(more);
        Ok(())
    }

    /// Ensures that one of the literals holds when timed initials make the others of a clause
    /// false.
    fn ensure_one_holds(
        &mut self,
        one: &WatchedClause,
        time: &Rational,
        mut rest: Vec<Literal>,
    ) -> Result<Option<WatchedClause>, Obstacle> {
        let settled = self.predicate("settled");
        if let Consequence::EffectOrObservation(_, answer) = &one.consequence {
            let later = self.predicate("later");
            self.timed(time.clone(), TimedChange::Add(later, Vec::new()));
            self.add_instantaneous(vec![answer.clone(), holds(later)], vec![add(settled)]);
        } else if rest.is_empty() {
            if self.has_rough_clauses() {
                return Err(ENDED);
            }
            return Err(Obstacle::ConstraintViolated(format!(
                "the constraint {} is violated at {}",
                one.constraint,
                time.to_decimal(3)
            )));
        }
        self.goals.push(holds(settled));
        if rest.is_empty() {
            return Ok(None);
        }
        let locked = self.predicate("locked");
        let open = self.predicate("open");
        let against = rest
            .iter()
            .flat_map(|literal| self.falsification_times(literal));
        match against.filter(|other| other < time).max() {
            Some(since) => self.timed(since, TimedChange::Add(open, Vec::new())),
            None => self.problem.initial_facts.push((open, Vec::new())),
        }
        self.timed(time.clone(), TimedChange::Delete(open, Vec::new()));
        self.timed(time.clone(), TimedChange::Delete(locked, Vec::new()));
        let numbers = &self.numbers;
        let ways: Vec<Condition> = rest.iter().map(|l| l.condition(numbers)).collect();
        self.add_instantaneous(
            vec![any(ways), holds(open)],
            vec![add(locked), add(settled)],
        );
        rest.push(Literal::without_arguments(locked, false));
        Ok(Some(WatchedClause {
            clause: rest,
            constraint: one.constraint.clone(),
            consequence: Consequence::Never,
            during: (Rational::ZERO, Some(Rational::ZERO)),
        }))
    }
}
