//! Up or down: which changes of numbers can spoil an over-all condition, and which can mend it.
//!
//! `(over all (>= (charge) 0))` minds a decrease and welcomes an increase. What spoils it must not
//! slip, in time, into an action that it comes after in the order of choices; what mends it must
//! not slip out. The other way round both are welcome, so that actions that only use up a
//! consumable are free to run side by side.

use elbowroom_model::ground::{Change, Condition, Effect, Expression, FluentId};
use elbowroom_model::problem::{Comparison, UpdateOperator};

use crate::embedded::formula::Numeric;
use crate::embedded::hash::Map;

/// Up, down, or both if it is not known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Direction {
    pub(super) up: bool,
    pub(super) down: bool,
}

impl Direction {
    /// Anything may be.
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

/// The directions in which a happening may change fluents.
#[derive(Clone, Debug, Default)]
pub(super) struct Shifts(Map<FluentId, Direction>);

impl Shifts {
    /// The shifts by these effects, whether or not they come about.
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
                // The judge minds a shift by nothing all the same.
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

    /// Where a fluent may be shifted that is shifted at all.
    pub(super) fn of_fluent(&self, fluent: FluentId) -> Direction {
        self.0.get(&fluent).copied().unwrap_or(Direction::BOTH)
    }
}

/// Which fluents a condition reads, and where each must go to make it true rather than false.
pub(super) fn wanted(condition: &Condition) -> Vec<(FluentId, Direction)> {
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
