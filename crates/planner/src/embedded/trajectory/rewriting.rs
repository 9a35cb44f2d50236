//! Compilation of a problem with constraints into one without, whose plans satisfy them.

use std::collections::BTreeSet;

use elbowroom_model::ground;
use elbowroom_model::problem::{Change, Condition, Expression, Problem, TimedChange};
use elbowroom_model::{Modal, Task};
use elbowroom_num::Rational;

use super::actions::{Changing, add, delete, holds, snaps};
use super::clauses::{Literal, LiteralSubject, Numbers, clauses, lifted};
use super::regression::{Moment, all, not};
use super::{Obstacle, counts_violations};

/// Maximum number of clauses that must always hold.
const MAX_CLAUSES: usize = 5_000;

const LONG: Obstacle =
    Obstacle::Feature("trajectory constraints on recursive derived facts or long formulas");
pub(super) const GUARDED: Obstacle = Obstacle::Feature(
    "trajectory constraints on facts changed by effects with conditions of other times",
);
pub(super) const MOVING: Obstacle = Obstacle::Feature(
    "trajectory constraints on numbers that change continuously, at given times, or in many ways",
);
const TOO_MANY: Obstacle = Obstacle::Feature("too many trajectory constraints");

/// A clause, and the consequence of a happening that makes it false.
#[derive(Clone, Debug)]
pub(super) struct WatchedClause {
    pub(super) clause: Vec<Literal>,
    /// The constraint that it is derived from.
    pub(super) constraint: String,
    pub(super) consequence: Consequence,
    /// Open interval of times. Outside of it, there is no consequence.
    pub(super) during: (Rational, Option<Rational>),
}

/// Consequence of making a clause false.
#[derive(Clone, Debug)]
pub(super) enum Consequence {
    /// No happening may make it false.
    Never,
    /// A happening that makes it false, while the condition holds, also has this effect.
    Effect(Condition, Change),
    /// As [`Effect`](Self::Effect). A violation by a timed initial is settled when the condition is
    /// observed later.
    EffectOrObservation(Change, Condition),
}

/// The constraints that a problem without constraints accounts for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Coverage {
    /// All of them; otherwise there is no such problem.
    All,
    /// Those that have such a form. The validator rejects the plans that break the others.
    Expressible,
}

pub(super) struct Rewriting<'a> {
    pub(super) task: &'a Task,
    coverage: Coverage,
    pub(super) problem: Problem,
    pub(super) numbers: Numbers,
    pub(super) goals: Vec<Condition>,
    pub(super) watched: Vec<WatchedClause>,
    /// Number of predicates of the task itself.
    own: usize,
}

/// Returns the problem without constraints. `demanded` are the preferences that it also enforces,
/// by position among the task's soft constraints.
pub(super) fn without_constraints(
    task: &Task,
    demanded: &[usize],
    coverage: Coverage,
) -> Result<Problem, Obstacle> {
    let mut rewriting = Rewriting::new(task, coverage);
    let constraints = task.constraints();
    let soft = demanded
        .iter()
        .flat_map(|&position| &constraints.soft[position].all);
    for modal in constraints.hard.iter().chain(soft) {
        let translated = rewriting.modal(modal);
        rewriting.apply_coverage(translated)?;
    }
    rewriting.finish()
}

/// Returns a relaxed problem that every plan of the task solves. Of the constraints, it keeps only
/// the conditions on the end.
pub(super) fn relaxed_problem(task: &Task) -> Problem {
    let mut rewriting = Rewriting::new(task, Coverage::Expressible);
    for modal in &task.constraints().hard {
        if let Modal::AtEnd(c) | Modal::HoldAfter(_, c) = modal {
            rewriting.goals.push(lifted(task, c));
        }
    }
    rewriting.problem.goal = all(rewriting.goals);
    rewriting.problem
}

impl<'a> Rewriting<'a> {
    fn new(task: &'a Task, coverage: Coverage) -> Self {
        let mut problem = task.problem().clone();
        // The validator counts violated preferences in the task itself.
        problem.constraints.clear();
        problem.action_preferences.clear();
        problem.domain_constraints = 0;
        if counts_violations(task) {
            problem.metric = None;
        }
        Self {
            task,
            coverage,
            goals: vec![problem.goal.clone()],
            own: problem.predicates.len(),
            problem,
            numbers: Numbers::default(),
            watched: Vec::new(),
        }
    }

    /// Returns an obstacle as an error, or `None` if the coverage permits omitting the constraint.
    pub(super) fn apply_coverage<T>(
        &self,
        found: Result<T, Obstacle>,
    ) -> Result<Option<T>, Obstacle> {
        match found {
            Ok(found) => Ok(Some(found)),
            Err(Obstacle::Feature(_)) if self.coverage == Coverage::Expressible => Ok(None),
            Err(obstacle) => Err(obstacle),
        }
    }

    fn modal(&mut self, modal: &Modal<ground::Condition>) -> Result<(), Obstacle> {
        let task = self.task;
        match modal {
            Modal::AtEnd(c) => self.goals.push(lifted(task, c)),
            Modal::Always(c) => {
                for clause in self.clauses(c, true)? {
                    self.watch(modal, clause, Consequence::Never);
                }
            }
            Modal::Sometime(c) => {
                let seen = self.add_observer(lifted(task, c), None);
                self.goals.push(holds(seen));
            }
            Modal::Within(time, c) => {
                let seen = self.add_observer(lifted(task, c), Some(time));
                self.goals.push(holds(seen));
            }
            Modal::SometimeBefore(c, d) => {
                let seen = self.add_observer(lifted(task, d), None);
                for mut clause in self.clauses(c, false)? {
                    clause.push(Literal::without_arguments(seen, true));
                    self.watch(modal, clause, Consequence::Never);
                }
            }
            Modal::AtMostOnce(c) => self.at_most_once(modal, c)?,
            Modal::SometimeAfter(c, d) => self.sometime_after(modal, c, d)?,
            Modal::AlwaysWithin(time, c, d) => self.always_within(modal, time, c, d)?,
            Modal::HoldDuring(from, until, c) => self.compile_hold(modal, from, Some(until), c)?,
            Modal::HoldAfter(from, c) => self.compile_hold(modal, from, None, c)?,
        }
        Ok(())
    }

    fn clauses(
        &mut self,
        condition: &ground::Condition,
        truth: bool,
    ) -> Result<Vec<Vec<Literal>>, Obstacle> {
        clauses(self.task, condition, truth, &mut self.numbers).ok_or(LONG)
    }

    /// Returns the clauses which state that `c` implies `d`.
    fn implications(
        &mut self,
        c: &ground::Condition,
        d: &ground::Condition,
    ) -> Result<Vec<Vec<Literal>>, Obstacle> {
        let either =
            ground::Condition::Or(vec![ground::Condition::Not(Box::new(c.clone())), d.clone()]);
        self.clauses(&either, true)
    }

    fn watch(
        &mut self,
        modal: &Modal<ground::Condition>,
        clause: Vec<Literal>,
        consequence: Consequence,
    ) {
        self.watched.push(WatchedClause {
            clause,
            constraint: self.task.describe_modal(modal),
            consequence,
            during: (Rational::ZERO, None),
        });
    }

    /// Compiles `at-most-once`: a happening that ends the condition records this, and then no
    /// happening may make the condition true.
    fn at_most_once(
        &mut self,
        modal: &Modal<ground::Condition>,
        c: &ground::Condition,
    ) -> Result<(), Obstacle> {
        let over = self.predicate("over");
        for clause in self.clauses(c, true)? {
            let ends = Consequence::Effect(lifted(self.task, c), add(over));
            for literal in &clause {
                for time in self.falsification_times(literal) {
                    // The condition may end then. A timed initial cannot check whether it does.
                    self.timed(time, TimedChange::Add(over, Vec::new()));
                }
            }
            self.watch(modal, clause, ends);
        }
        for mut clause in self.clauses(c, false)? {
            clause.push(Literal::without_arguments(over, false));
            self.watch(modal, clause, Consequence::Never);
        }
        Ok(())
    }

    /// Compiles `sometime-after`: making `c` true without `d` creates an obligation until an
    /// observer observes `d`.
    fn sometime_after(
        &mut self,
        modal: &Modal<ground::Condition>,
        c: &ground::Condition,
        d: &ground::Condition,
    ) -> Result<(), Obstacle> {
        let paid = self.predicate("paid");
        let found = self.implications(c, d)?;
        if found.iter().all(|clause| self.holds_initially(clause)) {
            self.problem.initial_facts.push((paid, Vec::new()));
        }
        let answer = lifted(self.task, d);
        self.add_instantaneous(vec![answer.clone()], vec![add(paid)]);
        self.goals.push(holds(paid));
        for clause in found {
            let owes = delete(paid);
            self.watch(
                modal,
                clause,
                Consequence::EffectOrObservation(owes, answer.clone()),
            );
        }
        Ok(())
    }

    /// Compiles `always-within`: `c` without `d` needs a waiting action, which ends in time, when
    /// `d` holds.
    fn always_within(
        &mut self,
        modal: &Modal<ground::Condition>,
        time: &Rational,
        c: &ground::Condition,
        d: &ground::Condition,
    ) -> Result<(), Obstacle> {
        let found = self.implications(c, d)?;
        let answer = lifted(self.task, d);
        let waits = self.add_waiting_action(time, answer.clone());
        let mut more = vec![Literal::without_arguments(waits, true)];
        if !found.iter().all(|clause| self.holds_initially(clause)) {
            // From the beginning, no waiting action is needed until `d` has been observed.
            let grace = self.predicate("grace");
            self.problem.initial_facts.push((grace, Vec::new()));
            let open = self.observation_window(time);
            let ends = delete(grace);
            self.add_instantaneous(vec![answer, holds(open)], vec![ends]);
            self.goals.push(not(holds(grace)));
            more.push(Literal::without_arguments(grace, true));
        }
        for mut clause in found {
            clause.extend(more.iter().cloned());
            self.watch(modal, clause, Consequence::Never);
        }
        Ok(())
    }

    /// Compiles `hold-during` and `hold-after`: an observer observes the condition by the time from
    /// which it must hold, and locks it.
    fn compile_hold(
        &mut self,
        modal: &Modal<ground::Condition>,
        from: &Rational,
        until: Option<&Rational>,
        c: &ground::Condition,
    ) -> Result<(), Obstacle> {
        if until.is_some_and(|until| until <= from) {
            return Ok(());
        }
        let found = self.clauses(c, true)?;
        if self.coverage == Coverage::Expressible {
            let changing = Changing::of(&self.problem);
            let mut literals = found.iter().flatten();
            if literals.any(|literal| self.moves(literal, &changing)) {
                self.hold_at_ends(from, until, c);
                return Ok(());
            }
        }
        let literals = found.iter().flatten();
        let against = literals.flat_map(|literal| self.falsification_times(literal));
        let since = against.filter(|time| time <= from).max();
        let locked = self.predicate("locked");
        let open = self.observation_window(from);
        if let Some(since) = &since {
            self.problem.initial_facts.retain(|(fact, _)| *fact != open);
            self.timed(since.clone(), TimedChange::Add(open, Vec::new()));
        }
        let seen = self.predicate("seen");
        let needs = vec![lifted(self.task, c), holds(open)];
        self.add_instantaneous(needs, vec![add(locked), add(seen)]);
        self.goals.push(holds(seen));
        if let Some(until) = until {
            self.timed(until.clone(), TimedChange::Delete(locked, Vec::new()));
        }
        for mut clause in found {
            clause.push(Literal::without_arguments(locked, false));
            self.watched.push(WatchedClause {
                clause,
                constraint: self.task.describe_modal(modal),
                consequence: Consequence::Never,
                during: (from.clone(), until.cloned()),
            });
        }
        Ok(())
    }

    /// Adds an observer at each end of the interval in which a condition on moving numbers has to hold. Between
    /// them, nothing is demanded.
    fn hold_at_ends(&mut self, from: &Rational, until: Option<&Rational>, c: &ground::Condition) {
        let epsilon = self.task.epsilon().clone();
        let before = until.map(|until| until - &epsilon - &epsilon - &epsilon);
        let before = before.filter(|before| before > from);
        for time in [Some(from.clone()), before].into_iter().flatten() {
            let open = self.predicate("open");
            self.timed(time.clone(), TimedChange::Add(open, Vec::new()));
            let close = time + &epsilon + &epsilon;
            self.timed(close, TimedChange::Delete(open, Vec::new()));
            let seen = self.predicate("seen");
            self.add_instantaneous(vec![lifted(self.task, c), holds(open)], vec![add(seen)]);
            self.goals.push(holds(seen));
        }
    }

    /// Returns `true` if a clause holds in the initial state.
    pub(super) fn holds_initially(&self, clause: &[Literal]) -> bool {
        let facts = &self.problem.initial_facts;
        let values = &self.problem.initial_values;
        clause.iter().any(|literal| {
            let is_true = match &literal.subject {
                LiteralSubject::Fact(predicate, objects) => facts
                    .iter()
                    .any(|(other, own)| other == predicate && own == objects),
                LiteralSubject::Number(position) => {
                    let (comparison, left, right) = self.numbers.get(*position);
                    let value = |side: &Expression| {
                        side.evaluate(&mut |leaf| {
                            let Expression::Fluent(fluent) = leaf else {
                                return None;
                            };
                            let same = |(function, objects, _): &&(_, Vec<_>, Rational)| {
                                *function == fluent.function
                                    && super::regression::objects(&fluent.arguments) == *objects
                            };
                            values.iter().find(same).map(|(.., value)| value.clone())
                        })
                    };
                    match (value(left), value(right)) {
                        (Some(left), Some(right)) => comparison.holds(&left, &right),
                        _ => return false,
                    }
                }
            };
            is_true == literal.truth
        })
    }

    /// Returns `true` if the literal reads a number that also changes outside of happenings of
    /// actions.
    fn moves(&self, literal: &Literal, changing: &Changing) -> bool {
        let LiteralSubject::Number(position) = &literal.subject else {
            return false;
        };
        let (_, left, right) = self.numbers.get(*position);
        let mut moves = false;
        for side in [left, right] {
            side.visit_fluents(&mut |fluent| moves |= changing.moving.contains(&fluent.function));
        }
        moves
    }

    fn finish(mut self) -> Result<Problem, Obstacle> {
        self.drop_static_parts()?;
        self.settle_timed()?;
        let numbers = std::mem::take(&mut self.numbers);
        let problem = self.problem.clone();
        let mut schemas = std::mem::take(&mut self.problem.schemas);
        for schema in &mut schemas {
            let parameters = schema.parameters.clone();
            for (condition, effects) in snaps(&mut schema.body) {
                let moment = Moment {
                    problem: &problem,
                    numbers: &numbers,
                    parameters: &parameters,
                    effects,
                };
                let (needs, more) = self.consequences(&moment)?;
                effects.extend(more);
                if !needs.is_empty() {
                    let own = std::mem::take(condition);
                    *condition = all([own].into_iter().chain(needs));
                }
            }
        }
        self.problem.schemas = schemas;
        self.problem.goal = all(self.goals);
        Ok(self.problem)
    }

    /// Removes clauses and literals on facts and fluents that never change, and reports a
    /// constraint that is already violated.
    fn drop_static_parts(&mut self) -> Result<(), Obstacle> {
        let changing = Changing::of(&self.problem);
        let mut known: BTreeSet<Vec<Literal>> = BTreeSet::new();
        let mut kept = Vec::new();
        for mut one in std::mem::take(&mut self.watched) {
            let is_never = matches!(one.consequence, Consequence::Never);
            if is_never && !self.holds_initially(&one.clause) {
                let constraint = one.constraint;
                return Err(Obstacle::ConstraintViolated(format!(
                    "the constraint {constraint} is violated from the beginning"
                )));
            }
            let is_static = |literal: &Literal| match &literal.subject {
                LiteralSubject::Fact(predicate, _) => {
                    predicate.index() < self.own && !changing.predicates.contains(predicate)
                }
                LiteralSubject::Number(position) => {
                    let (_, left, right) = self.numbers.get(*position);
                    let mut is_static = true;
                    for side in [left, right] {
                        side.visit_fluents(&mut |fluent| {
                            is_static &= !changing.functions.contains(&fluent.function);
                        });
                    }
                    is_static
                }
            };
            let (stays, mut rest): (Vec<_>, Vec<_>) = one.clause.into_iter().partition(is_static);
            if self.holds_initially(&stays) {
                continue;
            }
            rest.sort();
            rest.dedup();
            if rest.iter().any(|l| rest.contains(&l.clone().negated())) {
                continue;
            }
            if rest.iter().any(|literal| self.moves(literal, &changing)) {
                self.apply_coverage::<()>(Err(MOVING))?;
                continue;
            }
            if is_never && one.during == (Rational::ZERO, None) && !known.insert(rest.clone()) {
                continue;
            }
            one.clause = rest;
            kept.push(one);
            if kept.len() > MAX_CLAUSES {
                self.apply_coverage::<()>(Err(TOO_MANY))?;
                break;
            }
        }
        self.watched = kept;
        Ok(())
    }
}
