//! Numeric conditions and duration bounds of starts.

use elbowroom_model::ground::{Action, Body, Condition, DurationConstraint, Expression};
use elbowroom_num::Rational;

use super::BeliefState;
use super::over_all::CellView;
use super::polynomial::{Cell, cells};

impl BeliefState {
    /// Returns the numeric part of an action's start condition, with the bounds on its duration.
    pub(crate) fn numeric_start_condition(
        &self,
        action: &Action,
        duration: &Rational,
    ) -> Condition {
        let snap = match &action.body {
            Body::Instantaneous(snap) => snap,
            Body::Durative(body) => &body.start,
        };
        let reads_numbers = |part: &&Condition| {
            let mut reads = false;
            part.visit_comparisons(&mut |_, _| reads = true);
            self.task.visit_fluents_of(part, &mut |_| reads = true);
            reads
        };
        let parts = snap.condition.conjuncts().into_iter();
        let parts = parts.filter(reads_numbers).cloned();
        Condition::And(parts.chain(duration_bounds(action, duration)).collect())
    }

    /// Returns the first time after now, up to `until`, at which a condition holds if nothing
    /// happens before: a multiple of `grid` if there is one, or the exact time.
    pub(crate) fn next_satisfying_time(
        &self,
        condition: &Condition,
        duration: &Rational,
        until: &Rational,
        grid: &Rational,
    ) -> Option<Rational> {
        let motion = self.motion().ok().filter(|motion| !motion.is_still())?;
        let length = Some(until - &self.time).filter(Rational::is_positive)?;
        let view = |cell: Cell| CellView {
            state: self,
            motion: &motion,
            duration,
            cell,
        };
        let holds_at = |time: &Rational| {
            let elapsed = time - &self.time;
            let is_ahead = elapsed.is_positive() && elapsed <= length;
            is_ahead && view(Cell::Piece(elapsed)).holds(condition) == Ok(true)
        };
        let boundaries = view(Cell::JustAfterZero).boundaries(condition);
        let mut root = (Rational::ZERO, Rational::ZERO);
        for cell in cells(&boundaries, &length, Some(grid)) {
            if let Cell::Zero(from, to) = &cell {
                root = (from.clone(), to.clone());
            }
            if view(cell).holds(condition) != Ok(true) {
                continue;
            }
            // The zero is at most one step after its earliest time.
            let first = ((&self.time + &root.0) / grid).ceil() * grid;
            let steps = [0, 1, 2].map(|steps| &first + grid * Rational::from(steps));
            let exact = Some(&self.time + &root.0).filter(|_| root.0 == root.1);
            if let Some(time) = steps.into_iter().chain(exact).find(&holds_at) {
                return Some(time);
            }
        }
        holds_at(until).then(|| until.clone())
    }

    /// Returns `true` if continuous effects are changing a number that a condition reads.
    pub(crate) fn is_moving(&self, condition: &Condition) -> bool {
        let motion = self.motion().unwrap_or_default();
        let mut is_moving = false;
        self.task.visit_fluents_of(condition, &mut |fluent| {
            is_moving |= motion.is_changing(fluent)
        });
        is_moving
    }
}

/// Returns the bounds on an action's duration that are checked at its start, as conditions.
fn duration_bounds(action: &Action, duration: &Rational) -> Vec<Condition> {
    let body = action.durative();
    conditions_on_duration(body.into_iter().flat_map(|body| &body.duration), duration)
}

/// Returns those of these bounds that are checked at the start, as conditions.
pub(crate) fn conditions_on_duration<'a>(
    bounds: impl Iterator<Item = &'a DurationConstraint>,
    duration: &Rational,
) -> Vec<Condition> {
    let at_start = bounds.filter(|bound| !bound.at_end);
    let condition = |bound: &DurationConstraint| {
        let duration = Expression::Constant(duration.clone());
        Condition::Compare(bound.comparison, duration, bound.bound.clone())
    };
    at_start.map(condition).collect()
}
