//! The state at one moment, and how it moves until the next happening.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::polynomial::Polynomial;
use super::reading::{Fault, compare_signs, evaluate};
use crate::derivation::Moment;
use crate::ground::{Expression, FactId, FluentId};
use crate::problem::Comparison;
use crate::state::State;
use crate::task::Task;

/// Basic facts and values, by position in the task's tables.
#[derive(Clone, Debug)]
pub(super) struct Now {
    pub(super) facts: Vec<bool>,
    pub(super) values: Vec<Option<Rational>>,
}

impl Now {
    pub(super) fn of(task: &Task, state: &State) -> Self {
        let mut facts = vec![false; task.fact_count()];
        let mut values = vec![None; task.fluent_count()];
        for fact in &state.facts {
            facts[fact.index()] = true;
        }
        for (fluent, value) in &state.values {
            values[fluent.index()] = Some(value.clone());
        }
        Self { facts, values }
    }

    pub(super) fn value(&self, fluent: FluentId) -> Result<&Rational, Fault> {
        self.values[fluent.index()]
            .as_ref()
            .ok_or(Fault::Undefined(fluent))
    }

    /// As the rest of the crate writes states.
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
    pub(super) now: &'a Now,
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

/// How values change between two happening groups: each one a polynomial in the time since the
/// earlier group. What is not listed does not change.
#[derive(Clone, Debug, Default)]
pub(super) struct Motion(BTreeMap<FluentId, Polynomial>);

/// `d fluent / dt` has the term `per_time`, of a step with this duration.
pub(super) struct Rate<'a> {
    pub(super) step: usize,
    pub(super) fluent: FluentId,
    pub(super) per_time: &'a Expression,
    pub(super) duration: Option<&'a Rational>,
}

impl Motion {
    /// The motion from `now` on.
    ///
    /// A rate may itself read fluents that move (the values are then polynomials of a higher
    /// degree), as long as no fluent's rate depends on the fluent itself.
    /// If it cannot be read, the step to blame.
    pub(super) fn from(now: &Now, rates: &[Rate<'_>]) -> Result<Self, (usize, Fault)> {
        let mut terms: BTreeMap<FluentId, Vec<&Rate<'_>>> = BTreeMap::new();
        for rate in rates {
            terms.entry(rate.fluent).or_default().push(rate);
        }
        let mut motion = Self::default();
        while let Some((&stuck, unread)) = terms.first_key_value() {
            let is_ready = |rate: &&Rate<'_>| {
                let mut is_ready = true;
                rate.per_time
                    .visit_fluents(&mut |fluent| is_ready &= !terms.contains_key(&fluent));
                is_ready
            };
            let Some((&fluent, _)) = terms.iter().find(|(_, rates)| rates.iter().all(is_ready))
            else {
                return Err((unread[0].step, Fault::Circular(stuck)));
            };
            let mut speed = Polynomial::constant(Rational::ZERO);
            let mut step = 0;
            for rate in terms.remove(&fluent).into_iter().flatten() {
                let read = |fluent| motion.value(now, fluent);
                let term = evaluate(rate.per_time, rate.duration, &read);
                speed = speed.plus(&term.map_err(|fault| (rate.step, fault))?);
                step = rate.step;
            }
            let initial = now.value(fluent).map_err(|fault| (step, fault))?;
            motion.0.insert(fluent, speed.integral(initial.clone()));
        }
        Ok(motion)
    }

    pub(super) fn is_still(&self) -> bool {
        self.0.is_empty()
    }

    pub(super) fn moves(&self, fluent: FluentId) -> bool {
        self.0.contains_key(&fluent)
    }

    /// The value as a function of the time since `now`.
    pub(super) fn value(&self, now: &Now, fluent: FluentId) -> Result<Polynomial, Fault> {
        match self.0.get(&fluent) {
            Some(polynomial) => Ok(polynomial.clone()),
            None => Ok(Polynomial::constant(now.value(fluent)?.clone())),
        }
    }

    /// The state that this motion leads to after `elapsed`.
    pub(super) fn carry(&self, now: &mut Now, elapsed: &Rational) {
        for (fluent, polynomial) in &self.0 {
            now.values[fluent.index()] = Some(polynomial.at(elapsed));
        }
    }
}
