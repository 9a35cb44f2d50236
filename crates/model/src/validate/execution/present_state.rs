//! The state of an execution: on arrival at the present group, and now.

use std::collections::{BTreeMap, BTreeSet};

use elbowroom_num::Rational;

use super::super::evaluate::{Fault, evaluate};
use super::super::state::{BasicState, Motion, Rate};
use super::MeasuredAmount;
use crate::derivation;
use crate::ground::{Change, Expression, FactId, FluentId};
use crate::problem::{Comparison, UpdateOperator};
use crate::state::State;
use crate::task::Task;

/// Present facts and values, and those on arrival at the present group if they differ.
#[derive(Clone, Debug)]
pub(super) struct PresentState {
    now: BasicState,
    time: Rational,
    /// The time of the present group; earlier than `time` for a late report.
    group: Rational,
    facts_before: BTreeMap<FactId, bool>,
    values_before: BTreeMap<FluentId, Option<Rational>>,
    doubtful_facts: BTreeSet<FactId>,
    doubtful_values: BTreeSet<FluentId>,
}

/// Reason for a condition or an expression without a result.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Indeterminate {
    /// It reads a doubtful fact or value.
    DoubtfulRead,
    /// It cannot be evaluated.
    Fault(Fault),
}

/// A continuous effect: the fluent, its rate and the commanded duration of its action.
pub(super) type RateOf<'a> = (FluentId, &'a Expression, &'a Rational);

impl PresentState {
    pub(super) fn of(task: &Task, state: &State, time: Rational) -> Self {
        Self {
            now: BasicState::of(task, state),
            group: time.clone(),
            time,
            facts_before: BTreeMap::new(),
            values_before: BTreeMap::new(),
            doubtful_facts: BTreeSet::new(),
            doubtful_values: BTreeSet::new(),
        }
    }

    pub(super) fn time(&self) -> &Rational {
        &self.time
    }

    pub(super) fn now(&self) -> &BasicState {
        &self.now
    }

    /// Extends the state to all facts and fluents of the table.
    pub(super) fn extend_to_table(&mut self, task: &Task) {
        let (facts, fluents) = (task.fact_count(), task.fluent_count());
        if self.now.facts.len() < facts {
            self.now.facts.resize(facts, false);
        }
        if self.now.values.len() < fluents {
            self.now.values.resize(fluents, None);
        }
    }

    /// Begins a group at `time`, unless the present group has that time.
    pub(super) fn begin_group(&mut self, time: &Rational) {
        if self.group != *time {
            self.end_group(time);
        }
    }

    /// Makes the present state the state on arrival at a new group.
    pub(super) fn end_group(&mut self, time: &Rational) {
        self.group.clone_from(time);
        self.facts_before.clear();
        self.values_before.clear();
    }

    /// Returns the motion of values with these rates. If it is unknown, the values become doubtful and the motion
    /// is empty.
    pub(super) fn motion(&mut self, rates: &[RateOf<'_>]) -> Motion {
        if rates.is_empty() {
            return Motion::default();
        }
        let listed = rates.iter().map(|&(fluent, per_time, duration)| Rate {
            step: None,
            fluent,
            per_time,
            duration: Some(duration),
        });
        let listed: Vec<Rate<'_>> = listed.collect();
        Motion::from(&self.now, &listed).unwrap_or_else(|_| {
            let moving = rates.iter().map(|(fluent, ..)| *fluent);
            self.doubtful_values.extend(moving);
            Motion::default()
        })
    }

    /// Advances to the time `to`, if that is later than the present time.
    pub(super) fn pass(&mut self, to: &Rational, motion: &Motion) {
        if *to > self.time {
            motion.advance_state(&mut self.now, &(to - &self.time));
            self.time.clone_from(to);
            self.end_group(to);
        }
    }

    /// Applies a change. Its amount reads the state on arrival.
    pub(super) fn change(
        &mut self,
        change: &Change,
        duration: Option<&Rational>,
        measured: &[MeasuredAmount],
    ) {
        match change {
            Change::Add(fact) => self.set_fact(*fact, true),
            Change::Delete(fact) => self.set_fact(*fact, false),
            Change::Update {
                operator,
                fluent,
                value,
            } => {
                let known = measured.iter().find(|(own, _)| own == fluent);
                let amount = match known {
                    Some((_, amount)) => Ok(amount.clone()),
                    None => self.on_arrival(duration).value(value),
                };
                let old = self.value(*fluent).cloned();
                match amount
                    .ok()
                    .and_then(|amount| updated(*operator, old, amount))
                {
                    Some(new) => {
                        if *operator == UpdateOperator::Assign {
                            self.doubtful_values.remove(fluent);
                        }
                        self.set_value(*fluent, new);
                    }
                    // The amount is unknown, so the value is as well.
                    None => self.mark_value_doubtful(*fluent),
                }
            }
        }
    }

    /// Sets a fact that is seen, also in the state on arrival.
    pub(super) fn observe_fact(&mut self, fact: FactId, truth: bool) {
        self.set_fact(fact, truth);
        self.facts_before.remove(&fact);
    }

    /// Sets a value that is seen, also in the state on arrival.
    pub(super) fn observe_value(&mut self, fluent: FluentId, value: &Rational) {
        self.doubtful_values.remove(&fluent);
        self.set_value(fluent, value.clone());
        self.values_before.remove(&fluent);
    }

    /// Marks the fact or value of a change as doubtful.
    pub(super) fn mark_doubtful(&mut self, change: &Change) {
        match change {
            Change::Add(fact) | Change::Delete(fact) => {
                self.doubtful_facts.insert(*fact);
            }
            Change::Update { fluent, .. } => self.mark_value_doubtful(*fluent),
        }
    }

    pub(super) fn mark_value_doubtful(&mut self, fluent: FluentId) {
        self.doubtful_values.insert(fluent);
    }

    /// Marks the fact or value of a change as known.
    pub(super) fn mark_known(&mut self, change: &Change) {
        match change {
            Change::Add(fact) | Change::Delete(fact) => {
                self.doubtful_facts.remove(fact);
            }
            Change::Update { fluent, .. } => self.mark_value_known(*fluent),
        }
    }

    pub(super) fn mark_value_known(&mut self, fluent: FluentId) {
        self.doubtful_values.remove(&fluent);
    }

    /// Returns the state on arrival at the present group, with a value of `?duration` if there is one.
    pub(super) fn on_arrival<'a>(&'a self, duration: Option<&'a Rational>) -> Moment<'a> {
        Moment {
            course: self,
            duration,
        }
    }

    fn value(&self, fluent: FluentId) -> Option<&Rational> {
        self.now.values.get(fluent.index())?.as_ref()
    }

    fn set_fact(&mut self, fact: FactId, truth: bool) {
        if self.now.facts.len() <= fact.index() {
            self.now.facts.resize(fact.index() + 1, false);
        }
        let old = std::mem::replace(&mut self.now.facts[fact.index()], truth);
        self.facts_before.entry(fact).or_insert(old);
        self.doubtful_facts.remove(&fact);
    }

    fn set_value(&mut self, fluent: FluentId, value: Rational) {
        if self.now.values.len() <= fluent.index() {
            self.now.values.resize(fluent.index() + 1, None);
        }
        let old = self.now.values[fluent.index()].replace(value);
        self.values_before.entry(fluent).or_insert(old);
    }
}

fn updated(operator: UpdateOperator, old: Option<Rational>, amount: Rational) -> Option<Rational> {
    match operator {
        UpdateOperator::Assign => Some(amount),
        UpdateOperator::Increase => Some(old? + amount),
        UpdateOperator::Decrease => Some(old? - amount),
        UpdateOperator::ScaleUp => Some(old? * amount),
        UpdateOperator::ScaleDown => old?.checked_div(&amount),
    }
}

/// The state on arrival at the present group.
pub(super) struct Moment<'a> {
    course: &'a PresentState,
    duration: Option<&'a Rational>,
}

impl Moment<'_> {
    pub(super) fn value(&self, expression: &Expression) -> Result<Rational, Indeterminate> {
        let course = self.course;
        let mut is_doubtful = false;
        expression.visit_fluents(&mut |fluent| {
            is_doubtful |= course.doubtful_values.contains(&fluent);
        });
        if is_doubtful {
            return Err(Indeterminate::DoubtfulRead);
        }
        let value = evaluate(expression, self.duration, &|fluent| {
            let before = course.values_before.get(&fluent);
            let value = before.map_or_else(|| course.value(fluent), Option::as_ref);
            value.cloned().ok_or(Fault::Undefined(fluent))
        });
        value.map_err(Indeterminate::Fault)
    }
}

impl derivation::Moment<Indeterminate> for Moment<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, Indeterminate> {
        let course = self.course;
        if course.doubtful_facts.contains(&fact) {
            return Err(Indeterminate::DoubtfulRead);
        }
        let before = course.facts_before.get(&fact);
        let now = || course.now.facts.get(fact.index()).copied();
        Ok(before.copied().or_else(now).unwrap_or(false))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, Indeterminate> {
        Ok(comparison.holds(&self.value(left)?, &self.value(right)?))
    }
}
