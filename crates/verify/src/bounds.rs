//! Sums of bounds, linear in the ends of a box.

use std::collections::BTreeMap;

use elbowroom_num::Rational;

/// `constant + Σ factor · end`: ends are numbered, the lower one of parameter `p` is `2p`, the
/// upper one `2p + 1`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ends {
    /// What depends on no end.
    pub constant: Rational,
    /// What each end counts; none is zero.
    pub factors: BTreeMap<usize, Rational>,
}

impl Ends {
    /// A number.
    pub fn number(constant: Rational) -> Self {
        Self {
            constant,
            factors: BTreeMap::new(),
        }
    }

    /// So many times an end.
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

    /// Lets an end count so many times more.
    pub fn add(&mut self, end: usize, factor: &Rational) {
        let own = self.factors.entry(end).or_default();
        *own += factor;
        if own.is_zero() {
            self.factors.remove(&end);
        }
    }

    /// Whether a parameter occurs at both of its ends.
    pub fn tears(&self) -> bool {
        let ends: Vec<usize> = self.factors.keys().copied().collect();
        ends.windows(2).any(|pair| pair[0] / 2 == pair[1] / 2)
    }
}
