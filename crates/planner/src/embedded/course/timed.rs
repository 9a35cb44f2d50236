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
use super::clauses::{Literal, Matter};
use super::regression::any;
use super::rewriting::{Consequence, Rewriting, Watched};

const ENDED: Obstacle = Obstacle::Feature(
    "trajectory constraints under which timed initials may end what holds once at most",
);

impl Rewriting<'_> {
    /// Returns `true` if a clause may be stricter than its constraint: a condition that may hold
    /// once counts as over if timed initials may have ended it.
    fn has_rough_clauses(&self) -> bool {
        let mut constraints = self.task.constraints().hard.iter();
        constraints.any(|modal| matches!(modal, Modal::AtMostOnce(_)))
    }

    /// Returns the times at which timed initials make a literal false.
    pub(super) fn timed_against(&self, literal: &Literal) -> BTreeSet<Rational> {
        self.timed_to(literal, !literal.truth)
    }

    fn timed_to(&self, literal: &Literal, truth: bool) -> BTreeSet<Rational> {
        let Matter::Fact(predicate, objects) = &literal.matter else {
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
            let against = one.clause.iter().flat_map(|l| self.timed_against(l));
            let times: BTreeSet<Rational> = against.collect();
            let (from, until) = &one.during;
            let matters =
                |time: &&Rational| *time > from && until.as_ref().is_none_or(|until| *time < until);
            for time in times.iter().filter(matters) {
                let is_saved = |l: &Literal| self.timed_to(l, l.truth).contains(time);
                if one.clause.iter().any(is_saved) {
                    continue;
                }
                let is_lost = |l: &&Literal| self.timed_against(l).contains(time);
                let rest: Vec<Literal> =
                    one.clause.iter().filter(|l| !is_lost(l)).cloned().collect();
                let settled = self.settle(&one, time, rest);
                more.extend(self.covered(settled)?.flatten());
            }
        }
        self.watched.extend(more);
        Ok(())
    }

    /// Ensures that one of the literals holds when timed initials make the others of a clause
    /// false.
    fn settle(
        &mut self,
        one: &Watched,
        time: &Rational,
        mut rest: Vec<Literal>,
    ) -> Result<Option<Watched>, Obstacle> {
        let settled = self.predicate("settled");
        if let Consequence::Owes(_, answer) = &one.consequence {
            let later = self.predicate("later");
            self.timed(time.clone(), TimedChange::Add(later, Vec::new()));
            self.look(vec![answer.clone(), holds(later)], vec![add(settled)]);
        } else if rest.is_empty() {
            if self.has_rough_clauses() {
                return Err(ENDED);
            }
            return Err(Obstacle::Broken(format!(
                "the constraint {} is broken at {}",
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
        let against = rest.iter().flat_map(|literal| self.timed_against(literal));
        match against.filter(|other| other < time).max() {
            Some(since) => self.timed(since, TimedChange::Add(open, Vec::new())),
            None => self.problem.initial_facts.push((open, Vec::new())),
        }
        self.timed(time.clone(), TimedChange::Delete(open, Vec::new()));
        self.timed(time.clone(), TimedChange::Delete(locked, Vec::new()));
        let numbers = &self.numbers;
        let ways: Vec<Condition> = rest.iter().map(|l| l.condition(numbers)).collect();
        self.look(
            vec![any(ways), holds(open)],
            vec![add(locked), add(settled)],
        );
        rest.push(Literal::plain(locked, false));
        Ok(Some(Watched {
            clause: rest,
            constraint: one.constraint.clone(),
            consequence: Consequence::Never,
            during: (Rational::ZERO, Some(Rational::ZERO)),
        }))
    }
}
