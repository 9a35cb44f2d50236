//! Effects of happenings.

use elbowroom_model::ground::{Change, Effect, FluentId, SnapAction};
use elbowroom_model::problem::UpdateOperator;
use elbowroom_num::Rational;

use super::{BeliefState, EvaluationError, evaluation};
use crate::event::Measured;

impl BeliefState {
    /// Applies the effects of a happening. All of them read the state on arrival; deletions come
    /// before additions.
    pub(super) fn apply_effects(
        &mut self,
        snap: &SnapAction,
        duration: Option<&Rational>,
        guards: Option<&[bool]>,
        measured: &[Measured],
    ) -> Result<(), EvaluationError> {
        let mut outcome = Ok(());
        let takes_place = |(index, effect): &(usize, &Effect)| {
            guards.is_none_or(|guards| guards[*index])
                && self.holds_on_arrival(&effect.guard.now, duration) == Ok(true)
        };
        let effects = snap.effects.iter().enumerate();
        let due = effects
            .filter(takes_place)
            .map(|(_, effect)| self.amount(&effect.change, duration, measured));
        let mut due: Vec<(&Change, Result<Rational, EvaluationError>)> = due.collect();
        due.sort_by_key(|(change, _)| matches!(change, Change::Add(_)));
        for (change, amount) in due {
            outcome = outcome.and(amount.and_then(|amount| self.apply(change, &amount)));
        }
        outcome
    }

    /// Returns a change with its amount, read on arrival; 0 for facts.
    pub(super) fn amount<'c>(
        &self,
        change: &'c Change,
        duration: Option<&Rational>,
        measured: &[Measured],
    ) -> (&'c Change, Result<Rational, EvaluationError>) {
        let amount = match change {
            Change::Add(_) | Change::Delete(_) => Ok(Rational::ZERO),
            Change::Update { fluent, value, .. } => {
                match measured.iter().find(|measured| measured.fluent == *fluent) {
                    Some(measured) => Ok(measured.amount.clone()),
                    None => evaluation::evaluate(value, duration, &|fluent| {
                        self.value_on_arrival(fluent)
                    }),
                }
            }
        };
        (change, amount)
    }

    pub(super) fn apply(
        &mut self,
        change: &Change,
        amount: &Rational,
    ) -> Result<(), EvaluationError> {
        match change {
            Change::Add(fact) => self.set_fact(*fact, true),
            Change::Delete(fact) => self.set_fact(*fact, false),
            Change::Update {
                operator, fluent, ..
            } => {
                let old = self.value(*fluent).cloned();
                let new = updated(*operator, old, amount, *fluent)?;
                if *operator == UpdateOperator::Assign {
                    self.doubtful_values.remove(fluent);
                }
                self.set_value(*fluent, Some(new));
            }
        }
        Ok(())
    }
}

fn updated(
    operator: UpdateOperator,
    old: Option<Rational>,
    amount: &Rational,
    fluent: FluentId,
) -> Result<Rational, EvaluationError> {
    if operator == UpdateOperator::Assign {
        return Ok(amount.clone());
    }
    let old = old.ok_or(EvaluationError::Undefined(fluent))?;
    Ok(match operator {
        UpdateOperator::Assign => amount.clone(),
        UpdateOperator::Increase => old + amount,
        UpdateOperator::Decrease => old - amount,
        UpdateOperator::ScaleUp => old * amount,
        UpdateOperator::ScaleDown => old
            .checked_div(amount)
            .ok_or(EvaluationError::DivisionByZero)?,
    })
}
