//! Over-all conditions: they must hold at every moment strictly between start and end.
//!
//! From one happening group to the next, facts stay the same and fluents change as polynomials in
//! time. The crossings of the two sides of a comparison are found exactly. So a strict comparison
//! that becomes an equality exactly at the end holds, and one that fails for a while between two
//! groups does not.

use elbowroom_model::derivation::{Moment, holds};
use elbowroom_model::ground::{Condition, Expression, FactId};
use elbowroom_model::problem::Comparison;
use elbowroom_num::Rational;

use super::motion::{Fraction, Motion};
use super::polynomial::{Cell, cells};
use super::{BeliefState, EvaluationError, RunningActionState};
use crate::event::ActionHandle;

/// A span of time after the present happening group.
#[derive(Clone, Copy)]
enum Span<'a> {
    /// A sufficiently short interval.
    JustAfter,
    /// All moments before this much later.
    Until(&'a Rational),
}

/// The conditions that are violated in a span.
#[derive(Default)]
struct ViolatedConditions {
    /// Conjuncts of over-all conditions, by index.
    conditions: Vec<(ActionHandle, Vec<usize>)>,
    /// Guards: the ticket of the action, the index of the effect, and `true` for an end effect.
    guards: Vec<(ActionHandle, usize, bool)>,
}

impl BeliefState {
    /// Returns the running actions whose over-all condition fails from now on if nothing else
    /// happens at this moment, with the conjuncts that fail. For actions that started before, the
    /// present moment counts as well.
    pub fn failing_actions(&self) -> Vec<(ActionHandle, Vec<&Condition>)> {
        let motion = self.motion().unwrap_or_default();
        let lost = self
            .violated_conditions(&motion, Span::JustAfter)
            .conditions
            .into_iter();
        let breaking = lost.filter_map(|(ticket, parts)| {
            let body = self.running.get(&ticket)?.action.durative()?;
            let conjuncts = body.over_all.conjuncts();
            let parts = parts.into_iter().map(|index| conjuncts[index]);
            Some((ticket, parts.collect()))
        });
        breaking.collect()
    }

    /// Returns `true` if an over-all condition fails from now on that has not failed before.
    pub fn is_over_all_failing(&self) -> bool {
        let motion = self.motion().unwrap_or_default();
        let lost = self
            .violated_conditions(&motion, Span::JustAfter)
            .conditions;
        let is_new = |(ticket, parts): &(ActionHandle, Vec<usize>)| {
            let underway = self.running.get(ticket);
            underway.is_some_and(|it| parts.iter().any(|part| !it.broken.contains(part)))
        };
        lost.iter().any(is_new)
    }

    /// Returns the time before `until` at which an over-all condition that holds now has failed, if
    /// nothing happens before: the first multiple of `grid` after the failure.
    pub fn next_over_all_failure(&self, until: &Rational, grid: &Rational) -> Option<Rational> {
        let motion = self.motion().ok().filter(|motion| !motion.is_still())?;
        let length = Some(until - &self.time).filter(Rational::is_positive)?;
        let running = self.running.values();
        let first = running.filter_map(|underway| {
            let over_all = &underway.action.durative()?.over_all;
            let mut view = CellView {
                state: self,
                motion: &motion,
                duration: &underway.planned,
                cell: Cell::JustAfterZero,
            };
            let mut moment = Rational::ZERO;
            for cell in cells(&view.boundaries(over_all), &length, Some(grid)) {
                if let Cell::Zero(_, latest) = &cell {
                    moment.clone_from(latest);
                }
                view.cell = cell;
                if view.holds(over_all) != Ok(true) {
                    return Some(moment);
                }
            }
            None
        });
        let moment = &self.time + first.min()?;
        Some(((moment / grid).floor() + Rational::ONE) * grid)
    }

    /// Records the conditions that fail within the next `elapsed` time.
    pub(super) fn record_failures(&mut self, motion: &Motion, elapsed: &Rational) {
        let lost = self.violated_conditions(motion, Span::Until(elapsed));
        for (ticket, parts) in lost.conditions {
            if let Some(underway) = self.running.get_mut(&ticket) {
                underway.broken.extend(parts);
            }
        }
        for (ticket, index, is_end) in lost.guards {
            if let Some(underway) = self.running.get_mut(&ticket) {
                let guards = if is_end {
                    &mut underway.end_guards
                } else {
                    &mut underway.continuous
                };
                guards[index] = false;
            }
        }
    }

    fn violated_conditions(&self, motion: &Motion, span: Span<'_>) -> ViolatedConditions {
        let mut lost = ViolatedConditions::default();
        for (&ticket, underway) in &self.running {
            let Some(body) = underway.action.durative() else {
                continue;
            };
            let fails = |condition: &Condition| {
                !condition.is_trivial() && !self.holds_throughout(condition, underway, motion, span)
            };
            if fails(&body.over_all) {
                let parts = body.over_all.conjuncts().into_iter().enumerate();
                let failing = parts.filter(|(_, part)| fails(part));
                let failing = failing.map(|(index, _)| index).collect();
                lost.conditions.push((ticket, failing));
            }
            let ends = body.end.effects.iter().enumerate();
            let ends = ends.filter(|(_, effect)| fails(&effect.guard.over_all));
            lost.guards
                .extend(ends.map(|(index, _)| (ticket, index, true)));
            let rates = body.continuous.iter().enumerate();
            let rates = rates.filter(|(_, effect)| fails(&effect.guard.over_all));
            lost.guards
                .extend(rates.map(|(index, _)| (ticket, index, false)));
        }
        lost
    }

    /// Returns `true` if a condition of a running action holds throughout a span, and also now
    /// unless the action starts now.
    fn holds_throughout(
        &self,
        condition: &Condition,
        underway: &RunningActionState,
        motion: &Motion,
        span: Span<'_>,
    ) -> bool {
        let holds_now = || self.holds(condition, Some(&underway.planned)) == Ok(true);
        if motion.is_still() {
            return holds_now();
        }
        if underway.start < self.time && !holds_now() {
            return false;
        }
        let mut view = CellView {
            state: self,
            motion,
            duration: &underway.planned,
            cell: Cell::JustAfterZero,
        };
        let parts = match span {
            Span::JustAfter => vec![Cell::JustAfterZero],
            Span::Until(elapsed) => cells(&view.boundaries(condition), elapsed, None),
        };
        parts.into_iter().all(|cell| {
            view.cell = cell;
            view.holds(condition) == Ok(true)
        })
    }
}

/// The state in a cell of the time until the next group.
pub(super) struct CellView<'a> {
    pub(super) state: &'a BeliefState,
    pub(super) motion: &'a Motion,
    pub(super) duration: &'a Rational,
    pub(super) cell: Cell,
}

impl CellView<'_> {
    pub(super) fn holds(&self, condition: &Condition) -> Result<bool, EvaluationError> {
        match self.state.task.derivation() {
            Some(derivation) if derivation.is_read_by(condition) => {
                let derived = derivation.derive(self);
                holds(condition, &derivation.with_derived_facts(self, &derived))
            }
            _ => holds(condition, self),
        }
    }

    /// Returns polynomials at whose zeros the comparisons of a condition may change.
    pub(super) fn boundaries(&self, condition: &Condition) -> Vec<super::polynomial::Polynomial> {
        let mut found = Vec::new();
        let mut note = |left: &Expression, right: &Expression| {
            if let Ok(difference) = self.difference(left, right) {
                found.push(difference.numerator);
                found.push(difference.denominator);
            }
        };
        condition.visit_comparisons(&mut note);
        if let Some(derivation) = self.state.task.derivation()
            && derivation.is_read_by(condition)
        {
            derivation.visit_bodies(&mut |body| body.visit_comparisons(&mut note));
        }
        found
    }

    fn difference(
        &self,
        left: &Expression,
        right: &Expression,
    ) -> Result<Fraction, EvaluationError> {
        let now = |fluent| {
            let value = self.state.value(fluent).cloned();
            value.ok_or(EvaluationError::Undefined(fluent))
        };
        let read = |fluent| self.motion.value(fluent, &now);
        let side = |side: &Expression| Fraction::of(side, Some(self.duration), &read);
        Ok(side(left)?.minus(side(right)?))
    }
}

impl Moment<EvaluationError> for CellView<'_> {
    fn fact(&self, fact: FactId) -> Result<bool, EvaluationError> {
        Ok(self.state.fact(fact))
    }

    fn compare(
        &self,
        comparison: Comparison,
        left: &Expression,
        right: &Expression,
    ) -> Result<bool, EvaluationError> {
        let difference = self.difference(left, right)?;
        let divisor = difference.denominator.sign_in(&self.cell);
        if divisor == 0 {
            return Err(EvaluationError::DivisionByZero);
        }
        let sign = difference.numerator.sign_in(&self.cell) * divisor;
        Ok(comparison.holds(&Rational::from(i64::from(sign)), &Rational::ZERO))
    }
}
