//! Postponed starts in an order, if its probability stays the same.

use elbowroom_plan::{InstanceId, Node, NodeId};

use super::OrderSearch;
use super::run::TIE_TOLERANCE;
use crate::model::Event;
use crate::network::{Happenings, PrunedNetwork, TooCoupled};
use crate::search_state::SearchState;

impl OrderSearch {
    /// Moves starts behind ends that may fail and on whose effects the end of the started action
    /// depends, and behind the ends of actions that a failure of the started action would harm.
    ///
    /// The probability of an order does not count retries, so an order that starts both actions
    /// first is equally likely. But in that order, one failure makes both actions fail, and the
    /// second one may not be repeatable. A start is not moved if the order would be less likely or
    /// would have no schedule.
    pub(super) fn postponed(
        &self,
        circumstances: &SearchState,
        (sequence, probability): (Vec<NodeId>, f64),
    ) -> Result<Vec<NodeId>, TooCoupled> {
        let mut order = sequence.clone();
        for start in sequence {
            let Node::Start(id) = self.model.plan().nodes[start.index()] else {
                continue;
            };
            if let Some(moved) = self.with_start_postponed(&order, id)
                && self.is_as_likely(circumstances, &moved, probability)?
            {
                order = moved;
            }
        }
        Ok(order)
    }

    /// Returns the sequence with an action moved behind the last end that it should wait for: its
    /// start, and its end if that would come before the start otherwise. Returns `None` if it has
    /// nothing to wait for, or the plan's links forbid the change.
    fn with_start_postponed(&self, sequence: &[NodeId], id: InstanceId) -> Option<Vec<NodeId>> {
        let (start, end) = (self.model.start(id), self.model.end(id));
        let place = |wanted: NodeId| sequence.iter().position(|node| *node == wanted);
        let (from, own_end) = (place(start)?, place(end)?);
        let to = self.last_end_to_await(sequence, id, (from, own_end))?;
        let behind = &sequence[from + 1..=to];
        let may_follow = |own: NodeId| {
            let mut others = behind.iter().filter(|node| **node != end);
            others.all(|node| self.separations.may_precede(*node, own))
        };
        let mut moved = sequence.to_vec();
        if own_end > to {
            moved[from..=to].rotate_left(1);
            return may_follow(start).then_some(moved);
        }
        moved.splice(
            from..=to,
            behind.iter().copied().filter(|node| *node != end),
        );
        moved.splice(to - 1..to - 1, [start, end]);
        (may_follow(start) && may_follow(end)).then_some(moved)
    }

    /// Returns the position of the last end that an action should wait for; `from` and `own_end`
    /// are the positions of its start and end.
    fn last_end_to_await(
        &self,
        sequence: &[NodeId],
        own: InstanceId,
        (from, own_end): (usize, usize),
    ) -> Option<usize> {
        let mut behind = (from + 1..sequence.len()).rev();
        behind.find(|&at| match self.model.plan().nodes[sequence[at].index()] {
            Node::End(other) if other != own => {
                let is_harmed = self.is_harmed(other, own) && !self.is_harmed(own, other);
                is_harmed || at < own_end && self.is_awaited(other, own)
            }
            _ => false,
        })
    }

    /// Returns `true` if the end of `own` needs an effect of the end of `other`, which may go wrong.
    fn is_awaited(&self, other: InstanceId, own: InstanceId) -> bool {
        let needed = &self.model.event(self.model.end(own)).condition.literals;
        let event = self.model.event(self.model.end(other));
        let mut supporting = event.effects.iter();
        supporting.any(|effect| {
            needed.contains(&(effect.fact, effect.makes_true))
                && (effect.probability < 1.0 || self.may_fail(other, event))
        })
    }

    /// Returns `true` if a failure of `own` may undo a condition of `other`.
    fn is_harmed(&self, other: InstanceId, own: InstanceId) -> bool {
        let (start, end) = (self.model.start(other), self.model.end(other));
        let (start, end) = (self.model.event(start), self.model.event(end));
        let needed = [&start.condition, &start.over_all, &end.condition];
        let aftermaths = self
            .model
            .event(self.model.end(own))
            .failure_outcomes
            .iter();
        let mut changes = aftermaths.flat_map(|aftermath| &aftermath.changes);
        changes.any(|&(fact, becomes)| {
            let mut needed = needed.iter();
            needed.any(|requirement| requirement.literals.contains(&(fact, !becomes)))
        })
    }

    /// Returns `true` if an action may fail after its start.
    fn may_fail(&self, id: InstanceId, end: &Event) -> bool {
        let start = self.model.event(self.model.start(id));
        end.success < 1.0 || start.failures_per_second > 0.0
    }

    /// Returns `true` if a sequence has time and at least this probability.
    fn is_as_likely(
        &self,
        circumstances: &SearchState,
        sequence: &[NodeId],
        probability: f64,
    ) -> Result<bool, TooCoupled> {
        if self
            .windows_of(circumstances, Happenings::from(sequence))
            .is_none()
        {
            return Ok(false);
        }
        let mut network = PrunedNetwork::new(&self.model, circumstances)?;
        network.push_all(Happenings::from(sequence))?;
        Ok(network.success_probability()? >= probability * (1.0 - TIE_TOLERANCE))
    }
}
