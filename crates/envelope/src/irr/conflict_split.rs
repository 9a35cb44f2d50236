//! Division of long conflicts into conditions on few ends each: [`ConflictSplit`].
//!
//! If windows follow each other, a plan may be late by a little more in each of them, until it is
//! too late in one. There are as many such conflicts as pairs of windows, and the longer they are,
//! the weaker each of them is. They all hold if each piece, from one window to the next, uses at
//! most a share of the available slack. That is more than necessary, so the box may become a little
//! smaller, but it is found after a few checks.

use std::collections::BTreeSet;

use elbowroom_num::Rational;
use elbowroom_plan::{Bound, BoxEnd, DecoupledEnvelope, NodeId, Origin, ParametrizedPlan, Side};

use crate::cut::{Cut, EndSum, Ground, Length};
use crate::row::Row;

/// Number of ends above which a conflict counts as long.
const LONG_CONFLICT: usize = 10;

/// State of the division of conflicts: the points where they are divided, and the known pieces.
pub(super) struct ConflictSplit {
    bounds: Option<Bounds>,
    /// Work limit that is left, in parameters, for checks with long conflicts before these are
    /// divided.
    left: usize,
    /// The known pieces, by their ends.
    known: BTreeSet<Vec<Vec<BoxEnd>>>,
}

/// Earliest and latest times of points by single constraints.
struct Bounds {
    least: Times,
    most: Times,
}

/// By node: a time, if there is one.
type Times = Vec<Option<Rational>>;

impl ConflictSplit {
    /// Divides conflicts after checks with long conflicts have processed `left` parameters.
    pub(super) fn with_remaining(left: usize) -> Self {
        Self {
            bounds: None,
            left,
            known: BTreeSet::new(),
        }
    }

    /// Returns conditions that hold in `envelope`, which is inside the robustness envelope. Boxes
    /// that satisfy them do not have the long ones among these conflicts. Returns none until the
    /// work limit is used up.
    pub(super) fn split_conflicts(
        &mut self,
        plan: &ParametrizedPlan,
        cuts: &[Cut],
        envelope: &DecoupledEnvelope,
    ) -> Vec<Row> {
        let long = |cut: &&Cut| matches!(&cut.rows[..], [row] if row.factors.len() > LONG_CONFLICT);
        let long: Vec<&Cut> = cuts.iter().filter(long).collect();
        if long.is_empty() {
            return Vec::new();
        }
        self.left = self.left.saturating_sub(plan.parameters.len());
        if self.left > 0 {
            return Vec::new();
        }
        let bounds = self.bounds.get_or_insert_with(|| Bounds::new(plan));
        let mut rows = Vec::new();
        for cut in long {
            // The others involve waits, and are weak.
            let Ground::Cycle(origins) = &cut.ground else {
                continue;
            };
            for row in bounds.divide(plan, origins, envelope).unwrap_or_default() {
                let ends: Vec<BoxEnd> = row.factors.keys().collect();
                if !ends.is_empty() && row.holds_in(envelope) && self.known.insert(vec![ends]) {
                    rows.push(row);
                }
            }
        }
        rows
    }
}

impl Bounds {
    fn new(plan: &ParametrizedPlan) -> Self {
        let mut fixed = vec![None; plan.plan.nodes.len()];
        fixed[NodeId::ZERO.index()] = Some(Rational::ZERO);
        for constraint in &plan.plan.constraints {
            if let (NodeId::ZERO, Bound::Finite(time)) = (constraint.from, &constraint.lower)
                && constraint.lower == constraint.upper
            {
                fixed[constraint.to.index()] = Some(time.clone());
            }
        }
        let mut bounds = Self {
            least: fixed.clone(),
            most: fixed.clone(),
        };
        for constraint in &plan.plan.constraints {
            let (from, to) = (constraint.from, constraint.to);
            for (bound, is_least) in [(&constraint.lower, true), (&constraint.upper, false)] {
                let Bound::Finite(difference) = bound else {
                    continue;
                };
                if let Some(time) = &fixed[from.index()] {
                    bounds.add(to, is_least, time + difference);
                }
                if let Some(time) = &fixed[to.index()] {
                    bounds.add(from, !is_least, time - difference);
                }
            }
        }
        bounds
    }

    /// Adds the bound that the node comes at this time or later (or earlier).
    fn add(&mut self, node: NodeId, is_least: bool, time: Rational) {
        let side = if is_least {
            &mut self.least
        } else {
            &mut self.most
        };
        let own = &mut side[node.index()];
        if own.as_ref().is_none_or(|own| (time > *own) == is_least) {
            *own = Some(time);
        }
    }

    /// Splits a conflict at the points that have a bound, on the side with more such points. `None`
    /// if no point has a fixed time.
    fn divide(
        &self,
        plan: &ParametrizedPlan,
        origins: &[Origin],
        envelope: &DecoupledEnvelope,
    ) -> Option<Vec<Row>> {
        let steps: Vec<(Length, NodeId)> = origins
            .iter()
            .map(|&origin| step(plan, origin))
            .collect::<Option<_>>()?;
        let is_fixed = |node: NodeId| {
            let own = &self.least[node.index()];
            own.is_some() && *own == self.most[node.index()]
        };
        let first = steps.iter().position(|(_, to)| is_fixed(*to))?;
        let time = |side: &Times, node: NodeId| side[node.index()].clone();
        let count = |side: &Times| {
            let with_time = steps.iter().filter(|(_, to)| time(side, *to).is_some());
            with_time.count()
        };
        let is_least = count(&self.least) >= count(&self.most);
        let side = if is_least { &self.least } else { &self.most };
        // Each piece is the amount by which it exceeds the time between its bounds, up to the sign.
        let mut pieces = Vec::new();
        let mut piece = EndSum::constant(time(side, steps[first].1)?);
        for offset in 1..=steps.len() {
            let (length, to) = &steps[(first + offset) % steps.len()];
            piece.add_length(length);
            if let Some(time) = time(side, *to) {
                piece.constant -= &time;
                pieces.push(std::mem::replace(&mut piece, EndSum::constant(time)));
            }
        }
        if is_least {
            pieces.reverse();
        }
        // If a piece is too long, the next one begins too late by the same amount (or the previous
        // one has to end too early). That is so in the current box, and may remain so.
        let mut late = Rational::ZERO;
        let mut rows = Vec::with_capacity(pieces.len());
        for mut piece in pieces {
            piece.constant -= &late;
            late = (-piece.value(envelope)?).max(Rational::ZERO);
            piece.constant += &late;
            rows.push(piece.not_negative());
        }
        Some(rows)
    }
}

/// Returns the length of a step of a cycle, and its target.
fn step(plan: &ParametrizedPlan, origin: Origin) -> Option<(Length, NodeId)> {
    let (index, side) = match origin {
        Origin::Beginning => return Some((Length::Fixed(Rational::ZERO), NodeId::ZERO)),
        Origin::AtLeast(index) => (index, Side::Upper),
        Origin::AtMost(index) => (index, Side::Lower),
    };
    let constraint = &plan.plan.constraints[index];
    let (bound, to, sign) = match side {
        Side::Upper => (&constraint.lower, constraint.from, -1),
        Side::Lower => (&constraint.upper, constraint.to, 1),
    };
    let sign = Rational::from(sign);
    let length = match (plan.commanded_duration(constraint), bound) {
        (Some(planned), _) | (None, Bound::Finite(planned)) => Length::Fixed(planned * &sign),
        (None, &Bound::Parameter(parameter)) => Length::End(BoxEnd { parameter, side }, sign),
        (None, Bound::Infinite) => return None,
    };
    Some((length, to))
}
