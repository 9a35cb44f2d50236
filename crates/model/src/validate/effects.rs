//! Effects of happening groups.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

use super::abort::{Abort, EvaluationContext};
use super::evaluate::Fault;
use super::judge::Judge;
use super::state::Rate;
use super::timeline::{Group, HappeningKind};
use super::violation::{ConditionTime, ViolationKind};
use crate::ground::{Change, Effect, Expression, FactId, FluentId};
use crate::problem::UpdateOperator;

/// All changes of a group, computed before any of them is applied.
#[derive(Default)]
struct Changes<'a> {
    deletes: Vec<(FactId, HappeningKind<'a>)>,
    adds: Vec<(FactId, HappeningKind<'a>)>,
    updates: BTreeMap<FluentId, Vec<Update<'a>>>,
}

struct Update<'a> {
    operator: UpdateOperator,
    value: Rational,
    source: HappeningKind<'a>,
}

/// Returns the active continuous effects.
pub(super) fn rates<'b>(judge: &Judge<'b>) -> Vec<Rate<'b>> {
    let mut rates = Vec::new();
    for (&position, running) in &judge.running {
        let (step, body) = judge.durative(position);
        for (effect, _) in body
            .continuous
            .iter()
            .zip(&running.continuous)
            .filter(|(_, on)| **on)
        {
            rates.push(Rate {
                step: Some(position),
                fluent: effect.fluent,
                per_time: &effect.rate,
                duration: step.duration.as_ref(),
            });
        }
    }
    rates
}

impl<'a> Judge<'a> {
    /// Applies the effects of a group. All read the state on arrival, deletions come before
    /// additions, and actions that end stop running.
    pub(super) fn apply(&mut self, group: &Group<'a>) -> Result<(), Abort> {
        let mut changes = Changes::default();
        for happening in &group.happenings {
            self.collect(happening.kind, &group.time, &mut changes)?;
        }
        if self.settings.refuses_equal_writes {
            self.refuse_equal_writes(&changes, &group.time)?;
        }
        for (fluent, updates) in &changes.updates {
            self.update(*fluent, updates, &group.time)?;
        }
        let facts = changes.deletes.iter().map(|change| (change, false));
        for (&(fact, what), truth) in facts.chain(changes.adds.iter().map(|add| (add, true))) {
            let old = std::mem::replace(&mut self.now.facts[fact.index()], truth);
            if old != truth {
                self.last_changes.insert(fact, (group.time.clone(), what));
            }
        }
        self.derived.take();
        for happening in &group.happenings {
            if let HappeningKind::End(position) = happening.kind {
                self.running.remove(&position);
            }
        }
        Ok(())
    }

    fn collect(
        &self,
        what: HappeningKind<'a>,
        time: &Rational,
        changes: &mut Changes<'a>,
    ) -> Result<(), Abort> {
        if let HappeningKind::Timed(timed) = what {
            for change in &timed.changes {
                self.note(change, what, time, changes)?;
            }
        }
        let Some(snap) = self.snap(what) else {
            return Ok(());
        };
        for (index, effect) in snap.effects.iter().enumerate() {
            if self.is_effective(effect, index, what, time)? {
                self.note(&effect.change, what, time, changes)?;
            }
        }
        Ok(())
    }

    fn is_effective(
        &self,
        effect: &Effect,
        index: usize,
        what: HappeningKind<'a>,
        time: &Rational,
    ) -> Result<bool, Abort> {
        if effect.guard.is_trivial() {
            return Ok(true);
        }
        if let HappeningKind::End(position) = what
            && self
                .running
                .get(&position)
                .is_some_and(|running| !running.end_guards[index])
        {
            return Ok(false);
        }
        let place =
            EvaluationContext::condition(time, what.step(), ConditionTime::Now, &effect.guard.now);
        self.reads(&effect.guard.now, what.step())
            .map_err(|fault| self.to_abort(fault, &place))
    }

    fn note(
        &self,
        change: &Change,
        what: HappeningKind<'a>,
        time: &Rational,
        changes: &mut Changes<'a>,
    ) -> Result<(), Abort> {
        match change {
            Change::Add(fact) => changes.adds.push((*fact, what)),
            Change::Delete(fact) => changes.deletes.push((*fact, what)),
            Change::Update {
                operator,
                fluent,
                value,
            } => {
                let place = EvaluationContext::effect(time, what.step(), value);
                let value = self
                    .reading(what.step())
                    .value(value)
                    .map_err(|fault| self.to_abort(fault, &place))?;
                let update = Update {
                    operator: *operator,
                    value,
                    source: what,
                };
                changes.updates.entry(*fluent).or_default().push(update);
            }
        }
        Ok(())
    }

    /// Rejects two steps, or a step and a timed initial, that write the same fact.
    fn refuse_equal_writes(&self, changes: &Changes<'a>, time: &Rational) -> Result<(), Abort> {
        let mut writers: BTreeMap<FactId, HappeningKind<'a>> = BTreeMap::new();
        for (fact, what) in changes.deletes.iter().chain(&changes.adds) {
            let first = *writers.entry(*fact).or_insert(*what);
            if first.step() == what.step() {
                continue;
            }
            let mistake = ViolationKind::Interference {
                first: self.occurrence(first, time),
                second: self.occurrence(*what, time),
                over: self.task.fact_name(*fact),
                separation: None,
            };
            return Err(self.violation(time, what.step().or(first.step()), mistake));
        }
        Ok(())
    }

    /// Updates a fluent. Several updates of one fluent must all be increases or decreases.
    fn update(
        &mut self,
        fluent: FluentId,
        updates: &[Update<'a>],
        time: &Rational,
    ) -> Result<(), Abort> {
        let name = || self.task.fluent_name(fluent);
        let violates =
            |update: &Update<'a>, mistake| Err(self.violation(time, update.source.step(), mistake));
        let mut value = self.now.values[fluent.index()].clone();
        for update in updates {
            if updates.len() > 1 && !update.operator.is_additive() {
                return violates(update, ViolationKind::Conflict { fluent: name() });
            }
            let within = || format!("its effect {} {}", update.operator.name(), name());
            value = match (update.operator, value) {
                (UpdateOperator::Assign, _) => Some(update.value.clone()),
                (_, None) if matches!(self.now.value(fluent), Err(Fault::Irrational(_))) => {
                    let value = Expression::Fluent(fluent);
                    let place = EvaluationContext::effect(time, update.source.step(), &value);
                    return Err(self.to_abort(Fault::Irrational(fluent), &place));
                }
                (_, None) => {
                    let mistake = ViolationKind::Undefined {
                        fluent: name(),
                        within: within(),
                    };
                    return violates(update, mistake);
                }
                (UpdateOperator::Increase, Some(old)) => Some(old + &update.value),
                (UpdateOperator::Decrease, Some(old)) => Some(old - &update.value),
                (UpdateOperator::ScaleUp, Some(old)) => Some(old * &update.value),
                (UpdateOperator::ScaleDown, Some(old)) => {
                    let Some(quotient) = old.checked_div(&update.value) else {
                        let divisor = "its value".to_owned();
                        let mistake = ViolationKind::DivisionByZero {
                            divisor,
                            within: within(),
                        };
                        return violates(update, mistake);
                    };
                    Some(quotient)
                }
            };
        }
        if value.is_some() {
            self.now.set(fluent, value);
        }
        Ok(())
    }
}
