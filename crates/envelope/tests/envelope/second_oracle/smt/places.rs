//! Possible positions of a time point among all time points, by time.

use std::ops::RangeInclusive;

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, DecoupledEnvelope, ParametrizedPlan};

/// Possible positions of each time point but zero; the first is 1.
pub(crate) struct Places {
    ranges: Vec<RangeInclusive<usize>>,
    /// `[i][j]`: the greatest time from time point `i` to `j`.
    farthest: Vec<Vec<Option<Rational>>>,
}

impl Places {
    /// Allows any order.
    pub(crate) fn any(plan: &ParametrizedPlan) -> Self {
        let count = plan.plan.nodes.len() - 1;
        Self {
            ranges: vec![1..=count; count],
            farthest: vec![vec![None; count + 1]; count + 1],
        }
    }

    /// Returns the positions in schedules whose parameters lie in the box; `None` if there are
    /// none.
    ///
    /// If a node comes before a time point in all schedules, it also comes before it in the order.
    pub(crate) fn within(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Option<Self> {
        let farthest = farthest(plan, envelope);
        let count = plan.plan.nodes.len();
        if (0..count).any(|node| {
            farthest[node][node]
                .as_ref()
                .is_some_and(Rational::is_negative)
        }) {
            return None;
        }
        let precedes = |first: usize, second: usize| {
            let latest = &farthest[second][first];
            latest.as_ref().is_some_and(Rational::is_negative)
        };
        let ranges = (1..count)
            .map(|node| {
                let before = (1..count).filter(|&other| precedes(other, node)).count();
                let after = (1..count).filter(|&other| precedes(node, other)).count();
                before + 1..=count - 1 - after
            })
            .collect();
        Some(Self { ranges, farthest })
    }

    /// Returns `t_first < t_second` as text, simplified if the network decides it.
    pub(super) fn is_before(&self, first: usize, second: usize) -> String {
        if self
            .least_gap(first, second)
            .is_some_and(|gap| gap > Rational::ZERO)
        {
            "true".to_owned()
        } else if self.farthest[first][second]
            .as_ref()
            .is_some_and(|gap| *gap <= Rational::ZERO)
        {
            "false".to_owned()
        } else {
            format!("(< t{first} t{second})")
        }
    }

    /// Returns the least time from `first` to `second`.
    pub(super) fn least_gap(&self, first: usize, second: usize) -> Option<Rational> {
        self.farthest[second][first].as_ref().map(|most| -most)
    }

    pub(super) fn of(&self, node: usize) -> RangeInclusive<usize> {
        self.ranges[node - 1].clone()
    }
}

/// Computes `[i][j]`, the greatest time from time point `i` to `j`, by Floyd and Warshall's
/// algorithm.
fn farthest(plan: &ParametrizedPlan, envelope: &DecoupledEnvelope) -> Vec<Vec<Option<Rational>>> {
    let count = plan.plan.nodes.len();
    let mut most = vec![vec![None; count]; count];
    let mut limit = |from: usize, to: usize, value: Rational| {
        let here: &mut Option<Rational> = &mut most[from][to];
        if here.as_ref().is_none_or(|old| value < *old) {
            *here = Some(value);
        }
    };
    for node in 0..count {
        limit(node, node, Rational::ZERO);
        limit(node, 0, Rational::ZERO);
    }
    for constraint in &plan.plan.constraints {
        let (from, to) = (constraint.from.index(), constraint.to.index());
        let upper = match &constraint.upper {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => envelope.intervals()[id.index()].upper.value().cloned(),
        };
        let lower = match &constraint.lower {
            Bound::Infinite => None,
            Bound::Finite(value) => Some(value.clone()),
            Bound::Parameter(id) => envelope.intervals()[id.index()].lower.value().cloned(),
        };
        if let Some(upper) = upper {
            limit(from, to, upper);
        }
        if let Some(lower) = lower {
            limit(to, from, -lower);
        }
    }
    for via in 0..count {
        let onward = most[via].clone();
        for row in &mut most {
            let Some(first) = row[via].clone() else {
                continue;
            };
            for (here, second) in row.iter_mut().zip(&onward) {
                let Some(second) = second else { continue };
                let sum = &first + second;
                if here.as_ref().is_none_or(|old| sum < *old) {
                    *here = Some(sum);
                }
            }
        }
    }
    most
}
