//! Proofs that a network is not dynamically controllable.

use elbowroom_num::Rational;

use super::{Extended, LinkId};
use crate::{ConstraintId, NodeId, Weight};

/// The ground of one step of a [`Conflict`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Ground {
    /// A requirement.
    Requirement(ConstraintId),
    /// The end of the link may come as early as its lower bound.
    Early(LinkId),
    /// The end of the link may come as late as its upper bound.
    Late(LinkId),
}

/// Constraint `to - from <= bound` that holds in the case described by the conflict.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Step<W = Rational> {
    /// The time point that is subtracted.
    pub from: NodeId,
    /// The time point it is subtracted from.
    pub to: NodeId,
    /// Upper bound of the difference; infinite if a link without an upper bound never ends.
    pub bound: Extended<W>,
    /// Origin of the bound.
    pub ground: Ground,
}

/// Semi-reducible cycle of negative length (Morris 2006): requirements that cannot all be satisfied
/// if some links end early and others late, because the executor does not know in time which of
/// them do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Conflict<W = Rational> {
    /// The cycle, step by step; each step begins where the previous one ends, and the first where
    /// the last one ends. A very long cycle is truncated ([`Conflict::is_whole`]).
    pub steps: Vec<Step<W>>,
    /// `true` if `steps` contains the whole cycle.
    pub is_whole: bool,
    /// The length of the whole cycle; negative.
    pub total: Extended<W>,
}

impl<W: Weight> Conflict<W> {
    /// Returns the links that end early in the cycle, and those that end late, in order and without
    /// repetition.
    pub fn links(&self) -> (Vec<LinkId>, Vec<LinkId>) {
        let mut early = Vec::new();
        let mut late = Vec::new();
        for step in &self.steps {
            match step.ground {
                Ground::Requirement(_) => {}
                Ground::Early(link) => early.push(link),
                Ground::Late(link) => late.push(link),
            }
        }
        for links in [&mut early, &mut late] {
            links.sort_unstable();
            links.dedup();
        }
        (early, late)
    }

    /// Returns the same conflict with another number type.
    pub(super) fn map<V>(self, number: impl Fn(W) -> V) -> Conflict<V> {
        let steps = self.steps.into_iter().map(|step| Step {
            from: step.from,
            to: step.to,
            bound: step.bound.map(&number),
            ground: step.ground,
        });
        Conflict {
            steps: steps.collect(),
            is_whole: self.is_whole,
            total: self.total.map(&number),
        }
    }
}
