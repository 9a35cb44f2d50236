//! Linear inequalities in the ends of boxes.

use elbowroom_num::{Accumulator, Rational};
use elbowroom_plan::{BoxEnd, DecoupledEnvelope};

use crate::linear::Terms;

/// `Σ factor · reach(end) <= bound`, or `<` when strict: a half-space in the space of boxes. The
/// coordinates of a box are the reaches of its ends ([`BoxEnd::reach`]).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// The factor of each end; none is zero.
    pub factors: Terms<BoxEnd>,
    /// The upper bound of the sum.
    pub bound: Rational,
    /// `true` if the bound itself is excluded.
    pub is_strict: bool,
}

impl Row {
    /// Returns the left-hand side in a box; `None` if it contains an infinite end.
    pub fn value(&self, envelope: &DecoupledEnvelope) -> Option<Rational> {
        let mut value = Accumulator::default();
        for (end, factor) in &self.factors {
            value.add_product(&end.reach(envelope)?, factor);
        }
        Some(value.value())
    }

    /// Returns `true` if the row holds in a box.
    pub fn holds_in(&self, envelope: &DecoupledEnvelope) -> bool {
        self.value(envelope)
            .is_some_and(|value| value < self.bound || (value == self.bound && !self.is_strict))
    }
}
