//! Sums of bounds, linear in the ends of a box.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

/// `constant + Σ factor · end`. The ends are numbered: the lower end of parameter `p` is `2p`, the
/// upper end is `2p + 1`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EndExpression {
    /// Constant term.
    pub constant: Rational,
    /// Factor of each end; none is zero.
    pub factors: BTreeMap<usize, Rational>,
}

impl EndExpression {
    /// Returns a constant sum.
    pub fn number(constant: Rational) -> Self {
        Self {
            constant,
            factors: BTreeMap::new(),
        }
    }

    /// Returns `factor · end`.
    pub fn end(end: usize, factor: i64) -> Self {
        Self {
            constant: Rational::ZERO,
            factors: BTreeMap::from([(end, Rational::from(factor))]),
        }
    }

    /// Adds a sum to this one.
    pub fn add_sum(&mut self, other: &Self) {
        self.constant += &other.constant;
        for (end, factor) in &other.factors {
            self.add(*end, factor);
        }
    }

    /// Adds `factor · end`.
    pub fn add(&mut self, end: usize, factor: &Rational) {
        let own = self.factors.entry(end).or_default();
        *own += factor;
        if own.is_zero() {
            self.factors.remove(&end);
        }
    }

    /// Returns `true` if some parameter occurs with both of its ends.
    pub fn has_both_ends(&self) -> bool {
        let ends: Vec<usize> = self.factors.keys().copied().collect();
        ends.windows(2).any(|pair| pair[0] / 2 == pair[1] / 2)
    }
}
