//! State at one moment, and its motion until the next happening.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use super::evaluate::{Fault, compare_signs, evaluate};
use super::instant::Instant;
use super::polynomial::Polynomial;
use crate::derivation::Moment;
use crate::ground::{Expression, FactId, FluentId};
use crate::problem::Comparison;
use crate::state::State;
use crate::task::Task;

/// Basic facts and values, by position in the task's tables.
#[derive(Clone, Debug)]
pub(super) struct BasicState {
    pub(super) facts: Vec<bool>,
    pub(super) values: Vec<Option<Rational>>,
    /// Fluents with an irrational value, which is not stored: they stopped at an irrational moment.
    irrational: BTreeSet<FluentId>,
}

impl BasicState {
    pub(super) fn of(task: &Task, state: &State) -> Self {
        let mut facts = vec![false; task.fact_count()];
        let mut values = vec![None; task.fluent_count()];
        for fact in &state.facts {
            facts[fact.index()] = true;
        }
        for (fluent, value) in &state.values {
            values[fluent.index()] = Some(value.clone());
        }
        Self {
            facts,
            values,
            irrational: BTreeSet::new(),
        }
    }

    pub(super) fn value(&self, fluent: FluentId) -> Result<&Rational, Fault> {
        self.values[fluent.index()].as_ref().ok_or_else(|| {
            if self.irrational.contains(&fluent) {
                Fault::Irrational(fluent)
            } else {
                Fault::Undefined(fluent)
            }
        })
    }

    /// Sets the value of a fluent; `None` is an irrational value.
    pub(super) fn set(&mut self, fluent: FluentId, value: Option<Rational>) {
        if value.is_none() {
            self.irrational.insert(fluent);
        }
        self.values[fluent.index()] = value;
    }

    /// Converts the state to the public type.
    pub(super) fn to_state(&self) -> State {
        let position = |index: usize| u32::try_from(index).expect("ids are 32 bits wide");
        State {
            facts: (0..self.facts.len())
                .filter(|&index| self.facts[index])
                .map(|index| FactId(position(index)))
                .collect(),
            values: (0..self.values.len())
                .filter_map(|i| Some((FluentId(position(i)), self.values[i].clone()?)))
                .collect(),
        }
    }
}

/// Basic facts and numbers as one happening, of an action with this duration, reads them.
pub(super) struct Reading<'a> {
    pub(super) now: &'a BasicState,
    pub(super) duration: Option<&'a Rational>,
    pub(super) slack: &'a Rational,
}

impl Reading<'_> {
    pub(super) fn value(&self, expression: &Expression) -> Result<Rational, Fault> {
        evaluate(expression, self.duration, &|fluent| {
            self.now.value(fluent).cloned()
        })
    }
}

impl Moment<Fault> for Reading<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Fault> {
        Ok(self.now.facts[fact.index()])
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Fault> {
        let difference = self.value(left)? - self.value(right)?;
        let raised = (&difference + self.slack).signum();
        let lowered = (&difference - self.slack).signum();
        Ok(compare_signs(comparison, raised, lowered))
    }
}

/// Motion of values between two happening groups: each one is a polynomial in the time since the
/// earlier group. Fluents that are not listed are constant.
#[derive(Clone, Debug, Default)]
pub(super) struct Motion(BTreeMap<FluentId, Polynomial>);

/// Term `per_time` of `d fluent / dt`, of a step with this duration, or of a process.
pub(super) struct Rate<'a> {
    pub(super) step: Option<usize>,
    pub(super) fluent: FluentId,
    pub(super) per_time: &'a Expression,
    pub(super) duration: Option<&'a Rational>,
}

/// Fault of a motion, and the step to report if there is one.
type StepFault = (Option<usize>, Fault);

impl Motion {
    /// Returns the motion from `now` on.
    ///
    /// A rate may itself read fluents that move; the values are then polynomials of a higher
    /// degree. No fluent's rate may depend on the fluent itself.
    pub(super) fn from(now: &BasicState, rates: &[Rate<'_>]) -> Result<Self, StepFault> {
        let mut motion = Self::default();
        for (fluent, rates) in in_order(rates)? {
            let (speed, step) = motion.total_rate(now, &rates)?;
            let initial = now.value(fluent).map_err(|fault| (step, fault))?;
            let moved = speed.integral(initial.clone());
            motion.0.insert(fluent, moved);
        }
        Ok(motion)
    }

    /// Returns the motion from the moment `at` on, the end of the motion `before`, on the same
    /// clock. Fluents that no longer move get their values in `now`. If a coefficient would be
    /// irrational, the fluent has no value any more.
    pub(super) fn continued_from(
        now: &mut BasicState,
        before: &Self,
        rates: &[Rate<'_>],
        at: &Instant,
    ) -> Result<Self, StepFault> {
        let ordered = in_order(rates)?;
        let mut motion = Self::default();
        for (&fluent, polynomial) in &before.0 {
            if !ordered.iter().any(|(moving, _)| *moving == fluent) {
                now.set(fluent, at.value(polynomial));
            }
        }
        for (fluent, rates) in ordered {
            let step = rates[0].step;
            let parts = motion.total_rate(now, &rates).and_then(|(speed, _)| {
                let before = before.value(now, fluent).map_err(|fault| (step, fault))?;
                Ok((speed.integral(Rational::ZERO), before))
            });
            let constant = match &parts {
                Ok((change, before)) => at.value(&before.minus(change)),
                Err((_, Fault::Irrational(_))) => None,
                Err(blamed) => return Err(blamed.clone()),
            };
            if let (Ok((change, _)), Some(constant)) = (parts, constant) {
                let moved = change.plus(&Polynomial::constant(constant));
                motion.0.insert(fluent, moved);
            } else {
                now.set(fluent, None);
            }
        }
        Ok(motion)
    }

    /// Returns the sum of some rates of one fluent, and the last of their steps.
    fn total_rate(
        &self,
        now: &BasicState,
        rates: &[&Rate<'_>],
    ) -> Result<(Polynomial, Option<usize>), StepFault> {
        let mut speed = Polynomial::constant(Rational::ZERO);
        let mut step = None;
        for rate in rates {
            let read = |fluent| self.value(now, fluent);
            let term = evaluate(rate.per_time, rate.duration, &read);
            speed = speed.plus(&term.map_err(|fault| (rate.step, fault))?);
            step = rate.step;
        }
        Ok((speed, step))
    }

    /// Sets a fluent to the value of a polynomial on the clock of the motion.
    pub(super) fn set_value(
        &mut self,
        now: &mut BasicState,
        fluent: FluentId,
        polynomial: Polynomial,
    ) {
        if let Some(value) = polynomial.as_constant() {
            self.0.remove(&fluent);
            now.set(fluent, Some(value));
        } else {
            self.0.insert(fluent, polynomial);
        }
    }

    pub(super) fn is_constant(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn moves(&self, fluent: FluentId) -> bool {
        self.0.contains_key(&fluent)
    }

    /// Returns the value as a function of the time since `now`.
    pub(super) fn value(&self, now: &BasicState, fluent: FluentId) -> Result<Polynomial, Fault> {
        match self.0.get(&fluent) {
            Some(polynomial) => Ok(polynomial.clone()),
            None => Ok(Polynomial::constant(now.value(fluent)?.clone())),
        }
    }

    /// Advances the state by `elapsed`.
    pub(super) fn advance_state(&self, now: &mut BasicState, elapsed: &Rational) {
        for (fluent, polynomial) in &self.0 {
            now.values[fluent.index()] = Some(polynomial.at(elapsed));
        }
    }
}

/// Returns the rates by fluent, sorted so that those that others read come first.
fn in_order<'r, 'a>(
    rates: &'r [Rate<'a>],
) -> Result<Vec<(FluentId, Vec<&'r Rate<'a>>)>, StepFault> {
    let mut terms: BTreeMap<FluentId, Vec<&Rate<'_>>> = BTreeMap::new();
    for rate in rates {
        terms.entry(rate.fluent).or_default().push(rate);
    }
    let mut ordered = Vec::with_capacity(terms.len());
    while let Some((&stuck, unread)) = terms.first_key_value() {
        let is_ready = |rate: &&Rate<'_>| {
            let mut is_ready = true;
            rate.per_time
                .visit_fluents(&mut |fluent| is_ready &= !terms.contains_key(&fluent));
            is_ready
        };
        let ready = terms.iter().find(|(_, rates)| rates.iter().all(is_ready));
        let Some((&fluent, _)) = ready else {
            return Err((unread[0].step, Fault::Circular(stuck)));
        };
        let rates = terms.remove(&fluent).unwrap_or_default();
        ordered.push((fluent, rates));
    }
    Ok(ordered)
}
