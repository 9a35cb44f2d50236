//! Directions of change: whether an increase or a decrease of a number can break an over-all
//! condition, or satisfy it.
//!
//! `(over all (>= (charge) 0))` can be broken by a decrease and satisfied by an increase. A
//! breaking change that follows an action in the order of choices must not move, in time, into the
//! action. A satisfying change must not move out of it. Moves in the other direction are harmless,
//! so actions that only consume a resource may run concurrently.

use elbowroom_model::ground::{Change, Condition, Effect, Expression, FluentId};
use elbowroom_model::problem::{Comparison, UpdateOperator};

use crate::embedded::formula::Numeric;
use crate::embedded::hash::Map;

/// Up, down, or both if it is unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Direction {
    pub(super) up: bool,
    pub(super) down: bool,
}

impl Direction {
    /// Both directions are possible.
    pub(super) const BOTH: Self = Self {
        up: true,
        down: true,
    };

    fn and(self, other: Self) -> Self {
        Self {
            up: self.up || other.up,
            down: self.down || other.down,
        }
    }
}

/// The directions of the changes of fluents by a happening.
#[derive(Clone, Debug, Default)]
pub(super) struct Shifts(Map<FluentId, Direction>);

impl Shifts {
    /// Returns the shifts by these effects, regardless of their conditions.
    pub(super) fn of(effects: &[Effect]) -> Self {
        let mut shifts = Self::default();
        for effect in effects {
            let Change::Update {
                operator,
                fluent,
                value,
            } = &effect.change
            else {
                continue;
            };
            let amount = match value {
                Expression::Constant(amount) => Some(amount),
                _ => None,
            };
            let direction = match (operator, amount) {
                // The validator also counts a change by zero as a change.
                (_, Some(amount)) if amount.is_zero() => Direction::BOTH,
                (UpdateOperator::Increase, Some(amount)) => Direction {
                    up: amount.is_positive(),
                    down: amount.is_negative(),
                },
                (UpdateOperator::Decrease, Some(amount)) => Direction {
                    up: amount.is_negative(),
                    down: amount.is_positive(),
                },
                _ => Direction::BOTH,
            };
            let known = shifts.0.entry(*fluent).or_default();
            *known = known.and(direction);
        }
        shifts
    }

    /// Returns the possible directions of a changed fluent.
    pub(super) fn of_fluent(&self, fluent: FluentId) -> Direction {
        self.0.get(&fluent).copied().unwrap_or(Direction::BOTH)
    }
}

/// Returns the fluents that a condition reads, each with the directions of change that can make it
/// true.
pub(super) fn enabling_directions(condition: &Condition) -> Vec<(FluentId, Direction)> {
    let mut wanted: Vec<(FluentId, Direction)> = Vec::new();
    let mut note = |fluent: FluentId, direction: Direction| match wanted
        .iter_mut()
        .find(|known| known.0 == fluent)
    {
        Some(known) => known.1 = known.1.and(direction),
        None => wanted.push((fluent, direction)),
    };
    if let Condition::Compare(comparison, left, right) = condition {
        let difference = Expression::Subtract(Box::new(left.clone()), Box::new(right.clone()));
        if let Numeric::Linear(linear) = Numeric::of(difference) {
            for (fluent, coefficient) in &linear.terms {
                let rises = coefficient.is_positive();
                let direction = match comparison {
                    Comparison::AtLeast | Comparison::Greater => Direction {
                        up: rises,
                        down: !rises,
                    },
                    Comparison::AtMost | Comparison::Less => Direction {
                        up: !rises,
                        down: rises,
                    },
                    Comparison::Equal => Direction::BOTH,
                };
                note(FluentId(*fluent), direction);
            }
            return wanted;
        }
    }
    condition.visit_expressions(&mut |expression| {
        expression.visit_fluents(&mut |fluent| note(fluent, Direction::BOTH));
    });
    wanted
}
